"""Particle swarm search by global positions, for a body with `positioning`."""

from typing import ClassVar

from swarmwire.agent.behaviours.pso.by_places import ParticlesByPlaces, PositionedParticle
from swarmwire.agent.behaviours.pso.on_wheels import ParticlesOnWheels


class PsoSearchPositioned(ParticlesByPlaces, ParticlesOnWheels[PositionedParticle]):
    """Particle swarm search by global positions.

    The rule of PsoSearch. A best comes as a place; with a radio that reaches all, the neighbourhood is global.
    """

    needs: ClassVar[tuple[str, ...]] = ("light", "proximity", "compass", "positioning")
