"""Particles that are told where they are, and tell one another places."""

import numpy as np

from swarmwire.agent.behaviours.pso.particle import Bests, Particle
from swarmwire.agent.behaviours.pso.particle_swarm import ParticleSwarm
from swarmwire.agent.fields import Vectors
from swarmwire.agent.robots import Robots
from swarmwire.agent.vector_agent import FloatColumn, column
from swarmwire.comms.arrays import BoolArray
from swarmwire.comms.messages import Message, f4


class BestPlace(Message):
    """The brightest place that a robot has seen, in the arena's frame."""

    brightness: f4
    x_m: f4
    y_m: f4


class PositionedParticle(Particle):
    """A particle that is told where it is, in m, arena frame."""

    x_m: FloatColumn = column(np.nan)  # as in its last step
    y_m: FloatColumn = column(np.nan)


class ParticlesByPlaces(ParticleSwarm[PositionedParticle]):
    """A particle swarm of bodies with positioning."""

    def moved(self, robots: Robots, state: PositionedParticle) -> Vectors:
        """By the positions of now and then; their noise does not add up."""
        here = robots.positioning
        x, y = np.nan_to_num(here.x_m - state.x_m), np.nan_to_num(here.y_m - state.y_m)
        state.x_m[:] = here.x_m
        state.y_m[:] = here.y_m
        return Vectors(x, y)

    def tell(self, robots: Robots, state: PositionedParticle, rows: BoolArray) -> None:
        """The own best, as a place."""
        here = robots.positioning
        x, y = here.x_m + state.own_x, here.y_m + state.own_y
        robots.radio.send(BestPlace, rows=rows, brightness=state.own_brightness, x_m=x, y_m=y)

    def told(self, robots: Robots) -> Bests:
        """Places of those that were heard, seen from here."""
        heard = robots.radio.heard(BestPlace)
        here = robots.positioning
        x, y = heard.message.x_m - here.x_m[heard.row], heard.message.y_m - here.y_m[heard.row]
        return Bests(heard.row, heard.sender, heard.message.brightness, x, y)
