"""The point-particle model of the search: particle swarm optimisation at the robots' speed and with their radio."""

from typing import ClassVar

import numpy as np

from swarmwire.agent.behaviours.pso.by_places import ParticlesByPlaces, PositionedParticle
from swarmwire.agent.robots import Robots


class PsoModel(ParticlesByPlaces):
    """The point-particle model of a particle swarm search: no body, nothing in the way, exact positions.

    The rule of PsoSearch, made continuous as the second half of Pugh and Martinoli's (2007) paper has it: a particle
    flies straight to x + v with at most `speed_mps`, looks on its way, and waits there for the next update. For the
    body `point` with a light sense; it is the same model only under the robots' light and radio. Where the
    paper is silent, this is our reading.
    """

    needs: ClassVar[tuple[str, ...]] = ("light", "compass", "positioning")

    def head_for_target(self, robots: Robots, state: PositionedParticle) -> None:
        """Straight to the target in whatever direction, and no further."""
        away = np.hypot(state.target_x, state.target_y)
        bearing = np.arctan2(state.target_y, state.target_x) - robots.compass.heading_rad
        speed = np.minimum(self.speed_mps, away / robots.period_s)
        robots.drive(linear_mps=speed * np.cos(bearing), angular_radps=0.0, lateral_mps=speed * np.sin(bearing))
