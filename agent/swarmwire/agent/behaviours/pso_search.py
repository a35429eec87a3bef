"""Particle swarm search by what a robot itself can sense: wheels, compass, and a radio that tells range and bearing."""

from typing import ClassVar

import numpy as np

from swarmwire.agent.behaviours.pso.on_wheels import ParticlesOnWheels
from swarmwire.agent.behaviours.pso.particle import Bests, Particle
from swarmwire.agent.fields import Vectors, along
from swarmwire.agent.robots import Robots
from swarmwire.agent.vector_agent import FloatColumn, column
from swarmwire.comms.arrays import BoolArray
from swarmwire.comms.messages import Message, f4


class BestVector(Message):
    """The brightest place that a robot has seen, as a vector from where it is now."""

    brightness: f4
    x_m: f4  # along the axes of the compass
    y_m: f4


class WheeledParticle(Particle):
    """A particle that counts the turns of its wheels."""

    left_m: FloatColumn = column(np.nan)  # as in its last step
    right_m: FloatColumn = column(np.nan)


class PsoSearch(ParticlesOnWheels[WheeledParticle]):
    """Particle swarm search by what a robot itself senses: wheels, compass, and a radio that tells range and bearing.

    Neighbours are those whose broadcast is heard; a best comes as a vector from its sender, and the receiver adds where
    it hears the sender. Places are kept by dead reckoning: the mean way of both wheels, along the compass' heading.
    """

    needs: ClassVar[tuple[str, ...]] = ("light", "proximity", "compass", "odometry", "radio.range", "radio.bearing")

    def moved(self, robots: Robots, state: WheeledParticle) -> Vectors:
        """By the wheels, along the heading of now."""
        wheels = robots.odometry
        forward = np.nan_to_num(0.5 * ((wheels.left_m - state.left_m) + (wheels.right_m - state.right_m)))
        state.left_m[:] = wheels.left_m
        state.right_m[:] = wheels.right_m
        return forward * along(robots.compass.heading_rad)

    def tell(self, robots: Robots, state: WheeledParticle, rows: BoolArray) -> None:
        """The own best, as a vector from here."""
        robots.radio.send(BestVector, rows=rows, brightness=state.own_brightness, x_m=state.own_x, y_m=state.own_y)

    def told(self, robots: Robots) -> Bests:
        """Bests of those that were heard, seen from here."""
        heard = robots.radio.heard(BestVector)
        place = heard.range_m * along(heard.bearing_rad + robots.compass.heading_rad[heard.row])
        place += Vectors(heard.message.x_m, heard.message.y_m)
        return Bests(heard.row, heard.sender, heard.message.brightness, place.x, place.y)
