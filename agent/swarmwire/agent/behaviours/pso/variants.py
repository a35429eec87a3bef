"""Variants of the particle swarm search: by global positions or by dead reckoning, on wheels or as a point.

`PsoSearch` uses only what a robot measures itself: wheels, compass, and a radio with range and bearing.
`PsoSearchPositioned` uses global positions, and `PsoModel` is its point-particle model.
"""

from typing import ClassVar, Generic, TypeVar

import numpy as np

from swarmwire.agent.behaviours.pso.core import Bests, Particle, ParticleSwarm
from swarmwire.agent.fields import Vectors, along, repulsion_of_rays
from swarmwire.agent.robots import Robots
from swarmwire.agent.vector_agent import FloatColumn, column
from swarmwire.comms.base.arrays import BoolArray
from swarmwire.comms.robot.messages import Message, f4


class BestPlace(Message):
    """The brightest place that a robot has seen, in the arena's frame."""

    brightness: f4
    x_m: f4
    y_m: f4


class PositionedParticle(Particle):
    """A particle with positioning, in m, arena frame."""

    x_m: FloatColumn = column(np.nan)  # as in its last step
    y_m: FloatColumn = column(np.nan)


class ParticlesByPlaces(ParticleSwarm[PositionedParticle]):
    """A particle swarm of bodies with positioning."""

    def moved(self, robots: Robots, memory: PositionedParticle) -> Vectors:
        """By the positions of now and then; their noise does not add up."""
        here = robots.positioning
        x, y = np.nan_to_num(here.x_m - memory.x_m), np.nan_to_num(here.y_m - memory.y_m)
        memory.x_m[:] = here.x_m
        memory.y_m[:] = here.y_m
        return Vectors(x, y)

    def send_best(self, robots: Robots, memory: PositionedParticle, rows: BoolArray) -> None:
        """The own best, as a place."""
        here = robots.positioning
        x, y = here.x_m + memory.own_x, here.y_m + memory.own_y
        robots.radio.send(BestPlace, rows=rows, brightness=memory.own_brightness, x_m=x, y_m=y)

    def received_bests(self, robots: Robots) -> Bests:
        """Places of those that were received, seen from here."""
        received = robots.radio.received(BestPlace)
        here = robots.positioning
        x, y = received.message.x_m - here.x_m[received.row], received.message.y_m - here.y_m[received.row]
        return Bests(received.row, received.sender, received.message.brightness, x, y)


P = TypeVar("P", bound=Particle)


class ParticlesOnWheels(ParticleSwarm[P], Generic[P]):
    """A particle swarm of robots with proximity and compass, which turn to where they drive."""

    arrived_m: float = 0.05  # nearer than this to the target the robot waits
    avoidance: float = 2.0  # weight of the rays against the way to the target
    turn_gain_per_s: float = 3.0  # turn rate per angle to the wanted direction

    def head_for_target(self, robots: Robots, memory: P) -> None:
        """To the target, and away from near objects."""
        bearing = np.arctan2(memory.target_y, memory.target_x) - robots.compass.heading_rad
        pull = np.where(np.hypot(memory.target_x, memory.target_y) < self.arrived_m, 0.0, 1.0)
        wanted = pull * along(bearing) + self.avoidance * repulsion_of_rays(robots.proximity)
        angle, push = wanted.angle_rad, np.minimum(wanted.length, 1.0)
        linear = self.speed_mps * push * np.maximum(np.cos(angle), 0.0)
        robots.drive(linear_mps=linear, angular_radps=self.turn_gain_per_s * push * angle)


class PsoModel(ParticlesByPlaces):
    """The point-particle model of a particle swarm search: no body, nothing in the way, exact positions.

    The rule of PsoSearch, made continuous as the second half of Pugh and Martinoli's (2007) paper has it: a particle
    flies straight to x + v with at most `speed_mps`, looks on its way, and waits there for the next update. For the
    body `point` with a light sense; it is the same model only under the robots' light and radio. Where the
    paper is silent, this is our reading.
    """

    needs: ClassVar[tuple[str, ...]] = ("light", "compass", "positioning")

    def head_for_target(self, robots: Robots, memory: PositionedParticle) -> None:
        """Straight to the target, in any direction, without overshoot."""
        away = np.hypot(memory.target_x, memory.target_y)
        bearing = np.arctan2(memory.target_y, memory.target_x) - robots.compass.heading_rad
        speed = np.minimum(self.speed_mps, away / robots.period_s)
        robots.drive(linear_mps=speed * np.cos(bearing), angular_radps=0.0, lateral_mps=speed * np.sin(bearing))


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
    """Particle swarm search with a robot's own sensors: wheels, compass, and a radio that measures range and bearing.

    Neighbours are those whose broadcast is received; a best comes as a vector from its sender, and the receiver adds
    where it hears the sender. Places are kept by dead reckoning: the mean way of both wheels, along the compass'
    heading.
    """

    needs: ClassVar[tuple[str, ...]] = ("light", "proximity", "compass", "odometry", "radio.range", "radio.bearing")

    def moved(self, robots: Robots, memory: WheeledParticle) -> Vectors:
        """By the wheels, along the heading of now."""
        wheels = robots.odometry
        forward = np.nan_to_num(0.5 * ((wheels.left_m - memory.left_m) + (wheels.right_m - memory.right_m)))
        memory.left_m[:] = wheels.left_m
        memory.right_m[:] = wheels.right_m
        return forward * along(robots.compass.heading_rad)

    def send_best(self, robots: Robots, memory: WheeledParticle, rows: BoolArray) -> None:
        """The own best, as a vector from here."""
        robots.radio.send(BestVector, rows=rows, brightness=memory.own_brightness, x_m=memory.own_x, y_m=memory.own_y)

    def received_bests(self, robots: Robots) -> Bests:
        """Bests of those that were received, seen from here."""
        received = robots.radio.received(BestVector)
        place = received.range_m * along(received.bearing_rad + robots.compass.heading_rad[received.row])
        place += Vectors(received.message.x_m, received.message.y_m)
        return Bests(received.row, received.sender, received.message.brightness, place.x, place.y)


class PsoSearchPositioned(ParticlesByPlaces, ParticlesOnWheels[PositionedParticle]):
    """Particle swarm search by global positions.

    The rule of PsoSearch. A best comes as a place; with a radio that reaches all, the neighbourhood is global.
    """

    needs: ClassVar[tuple[str, ...]] = ("light", "proximity", "compass", "positioning")
