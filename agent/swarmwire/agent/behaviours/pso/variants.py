"""Variants of the particle swarm search: by global positions or by dead reckoning, on wheels or as a point.

`PsoSearch` uses only sensors of the robot: wheels, compass, and a radio with range and bearing. `PsoSearchPositioned`
uses global positions, and `PsoModel` is its point-particle model.
"""

from typing import ClassVar, Generic, TypeVar

import numpy as np

from swarmwire.agent import portable
from swarmwire.agent.behaviours.pso.core import Bests, Particle, ParticleSwarm
from swarmwire.agent.fields import Vectors, along, repulsion_of_rays
from swarmwire.agent.robots import Robots
from swarmwire.agent.vector_agent import FloatColumn, column
from swarmwire.comms.base.arrays import BoolArray, FloatArray
from swarmwire.comms.base.config import parameter
from swarmwire.comms.robot.messages import Message, f4


class BestPlace(Message):
    """A robot's personal best, as a position in the arena's frame."""

    brightness: f4
    x_m: f4
    y_m: f4


class PositionedParticle(Particle):
    """A particle with positioning."""

    x_m: FloatColumn = column(np.nan)  # position in the last step, in the arena's frame
    y_m: FloatColumn = column(np.nan)


class PositionedSwarm(ParticleSwarm[PositionedParticle]):
    """A particle swarm of bodies with positioning."""

    def moved(self, robots: Robots, memory: PositionedParticle) -> Vectors:
        """Return the difference of two positions; their noise does not add up."""
        position = robots.positioning
        x, y = np.nan_to_num(position.x_m - memory.x_m), np.nan_to_num(position.y_m - memory.y_m)
        memory.x_m[:] = position.x_m
        memory.y_m[:] = position.y_m
        return Vectors(x, y)

    def send_best(self, robots: Robots, memory: PositionedParticle, rows: BoolArray) -> None:
        """Broadcast personal bests as positions in the arena."""
        position = robots.positioning
        x, y = position.x_m + memory.personal_x, position.y_m + memory.personal_y
        robots.radio.send(BestPlace, rows=rows, brightness=memory.personal_brightness, x_m=x, y_m=y)

    def received_bests(self, robots: Robots) -> Bests:
        """Return received bests relative to the receivers."""
        received = robots.radio.received(BestPlace)
        position = robots.positioning
        x = received.message.x_m - position.x_m[received.row]
        y = received.message.y_m - position.y_m[received.row]
        return Bests(received.row, received.sender, received.message.brightness, x, y)


P = TypeVar("P", bound=Particle)


class WheeledSwarm(ParticleSwarm[P], Generic[P]):
    """A particle swarm of robots with wheels, proximity rays and a compass."""

    arrived_m: float = parameter(0.05, help="distance from the target below which the robot waits")
    avoidance: float = parameter(2.0, help="weight of the rays, relative to the direction of the target")
    turn_gain_per_s: float = parameter(3.0, help="turn rate per angle to the desired direction")

    def head_for_target(self, robots: Robots, memory: P) -> None:
        """Drive towards the target, and away from near objects."""
        bearing = portable.atan2(memory.target_y, memory.target_x) - robots.compass.heading_rad
        target_m: FloatArray = portable.hypot(memory.target_x, memory.target_y)
        attraction = np.where(target_m < self.arrived_m, 0.0, 1.0)
        desired: Vectors = attraction * along(bearing) + self.avoidance * repulsion_of_rays(robots.proximity)
        angle, strength = desired.angle_rad, np.minimum(desired.length, 1.0)
        linear = self.speed_mps * strength * np.maximum(portable.cos(angle), 0.0)
        robots.drive(linear_mps=linear, angular_radps=self.turn_gain_per_s * strength * angle)


class PsoModel(PositionedSwarm):
    """The point-particle model of a particle swarm search: no body, no obstacles, exact positions.

    The rule of PsoSearch in continuous time, as in the second half of the paper by Pugh and Martinoli (2007): a
    particle flies straight to x + v with at most `speed_mps`, measures on its way, and waits there for the next update.
    For the body `point` with a light sensor, under the same light and radio as the robots. Details that the paper
    leaves open are our choice.
    """

    needs: ClassVar[tuple[str, ...]] = ("light", "compass", "positioning")

    def head_for_target(self, robots: Robots, memory: PositionedParticle) -> None:
        """Drive straight to the target, in any direction, without overshoot."""
        distance = portable.hypot(memory.target_x, memory.target_y)
        bearing = portable.atan2(memory.target_y, memory.target_x) - robots.compass.heading_rad
        speed = np.minimum(self.speed_mps, distance / robots.period_s)
        robots.drive(
            linear_mps=speed * portable.cos(bearing), angular_radps=0.0, lateral_mps=speed * portable.sin(bearing)
        )


class BestVector(Message):
    """A robot's personal best, relative to its present position."""

    brightness: f4
    x_m: f4  # along the x axis of the compass
    y_m: f4


class WheeledParticle(Particle):
    """A particle with odometry."""

    left_m: FloatColumn = column(np.nan)  # travel of the left wheel in the last step
    right_m: FloatColumn = column(np.nan)


class PsoSearch(WheeledSwarm[WheeledParticle]):
    """Particle swarm search with a robot's own sensors: wheels, compass, and a radio that measures range and bearing.

    A best is sent as a vector from its sender; the receiver adds range and bearing of the packet. Remembered positions
    are updated by dead reckoning: the mean travel of both wheels, along the heading of the compass.
    """

    needs: ClassVar[tuple[str, ...]] = ("light", "proximity", "compass", "odometry", "radio.range", "radio.bearing")

    def moved(self, robots: Robots, memory: WheeledParticle) -> Vectors:
        """Return the mean travel of both wheels, along the present heading."""
        wheels = robots.odometry
        forward = np.nan_to_num(0.5 * ((wheels.left_m - memory.left_m) + (wheels.right_m - memory.right_m)))
        memory.left_m[:] = wheels.left_m
        memory.right_m[:] = wheels.right_m
        return forward * along(robots.compass.heading_rad)

    def send_best(self, robots: Robots, memory: WheeledParticle, rows: BoolArray) -> None:
        """Broadcast personal bests as vectors from the robots."""
        x, y = memory.personal_x, memory.personal_y
        robots.radio.send(BestVector, rows=rows, brightness=memory.personal_brightness, x_m=x, y_m=y)

    def received_bests(self, robots: Robots) -> Bests:
        """Return received bests relative to the receivers."""
        received = robots.radio.received(BestVector)
        position = received.range_m * along(received.bearing_rad + robots.compass.heading_rad[received.row])
        position += Vectors(received.message.x_m, received.message.y_m)
        return Bests(received.row, received.sender, received.message.brightness, position.x, position.y)


class PsoSearchPositioned(PositionedSwarm, WheeledSwarm[PositionedParticle]):
    """Particle swarm search by global positions.

    The rule of PsoSearch, with bests as positions in the arena. If the radio reaches all robots, the neighbourhood is
    global.
    """

    needs: ClassVar[tuple[str, ...]] = ("light", "proximity", "compass", "positioning")
