"""Vector fields for VectorAgents: from packets and rays to a steering command.

Fields of neighbours give a vector per packet, and `mean_received` averages them per robot. They are Reynolds's three
rules (Flocks, Herds, and Schools, 1987) as primitives of one formula each, with lengths between 0 and 1. Fields of rays
give a vector per robot, away from near objects. `low_pass` and `hysteresis` keep a command from flickering, and
`steered` turns a vector into speeds.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from swarmwire.agent import portable
from swarmwire.agent.packet import Packets
from swarmwire.comms.base.arrays import BoolArray, FloatArray
from swarmwire.comms.robot.sensors.rays import ProximityReading


@dataclass(slots=True)  # not frozen: a step makes many of them, and a frozen one takes four times as long
class Vectors:
    """Vectors, each in the frame of its robot, all without a unit, or all in the same unit.

    They can be added, and multiplied by a number or an array: `0.6 * pull - 3.0 * near`.
    """

    x: FloatArray  #: forward, (k,) for packets or (n,) for robots
    y: FloatArray  #: leftward

    __array_ufunc__ = None  # an array on the left then multiplies all vectors at once

    @property
    def length(self) -> FloatArray:
        """Lengths."""
        return portable.hypot(self.x, self.y)

    @property
    def angle_rad(self) -> FloatArray:
        """Directions in [-pi, pi], 0 ahead, positive to the left; 0 for a vector of no length."""
        return portable.atan2(self.y, self.x)

    def turned(self, by_rad: FloatArray) -> "Vectors":
        """Return the vectors turned to the left, each by its angle.

        A turn by the robot's heading leads from the robot's frame to the axes of the compass, its negative back.
        """
        cosine, sine = portable.cos(by_rad), portable.sin(by_rad)
        return Vectors(self.x * cosine - self.y * sine, self.x * sine + self.y * cosine)

    def __add__(self, other: "Vectors") -> "Vectors":
        return Vectors(self.x + other.x, self.y + other.y)

    def __sub__(self, other: "Vectors") -> "Vectors":
        return Vectors(self.x - other.x, self.y - other.y)

    def __mul__(self, weight: float | FloatArray) -> "Vectors":
        return Vectors(weight * self.x, weight * self.y)

    __rmul__ = __mul__


def along(angle_rad: FloatArray) -> Vectors:
    """Return vectors of length 1 in these directions."""
    return Vectors(portable.cos(angle_rad), portable.sin(angle_rad))


def ahead(n: int) -> Vectors:
    """Return vectors of length 1 straight ahead, for n robots."""
    return Vectors(np.ones(n), np.zeros(n))


def attraction(range_m: FloatArray, bearing_rad: FloatArray, rest_m: float) -> Vectors:
    """Return vectors towards neighbours farther than `rest_m`, (k,): min((d - rest_m) / rest_m, 1) long, 0 nearer.

    `range_m` and `bearing_rad` (k,) are those of the packets.
    """
    return np.minimum(np.maximum((range_m - rest_m) / rest_m, 0.0), 1.0) * along(bearing_rad)


def repulsion(range_m: FloatArray, bearing_rad: FloatArray, rest_m: float) -> Vectors:
    """Return vectors away from neighbours nearer than `rest_m`, (k,): (rest_m - d) / rest_m long, 0 farther."""
    return np.minimum((range_m - rest_m) / rest_m, 0.0) * along(bearing_rad)


def spacing(range_m: FloatArray, bearing_rad: FloatArray, rest_m: float) -> Vectors:
    """Return the sum of attraction and repulsion, (k,): to neighbours farther than `rest_m`, away from nearer ones."""
    return np.minimum((range_m - rest_m) / rest_m, 1.0) * along(bearing_rad)


def alignment(their_heading_rad: FloatArray, own_heading_rad: FloatArray) -> Vectors:
    """Return the heading of each neighbour as a vector of length 1, (k,); both headings (k,) are of aligned compasses.

    For received packets, `own_heading_rad` is `heading_rad[received.row]`.
    """
    return along(their_heading_rad - own_heading_rad)


def mean_received(received: Packets[Any], vectors: Vectors) -> Vectors:
    """Return the mean of vectors (k,) over the packets that each robot received, (n,); length 0 without packets."""
    packets = np.maximum(received.count(), 1)
    return Vectors(received.sum(vectors.x) / packets, received.sum(vectors.y) / packets)


def repulsion_of_rays(proximity: ProximityReading[Any]) -> Vectors:
    """Return vectors away from objects, (n,): minus the sum of the rays' vectors, each `value` long.

    A `value` is 0 to 1: a ray that touches an object has length 1, a ray that sees none has length 0.
    """
    x, y = proximity.vector_sum()
    return Vectors(-x, -y)


def repulsion_of_ranges(range_m: FloatArray, angle_rad: FloatArray, reach_m: float) -> Vectors:
    """Return vectors away from objects, (n,): minus the mean of the rays' vectors, each 1 - d / reach_m long.

    `range_m` (n, rays) is inf or more than `reach_m` where a ray sees nothing, `angle_rad` (rays,) is its direction, as
    in a laser scan. The mean over all rays does not depend on their number; a wall that fills the half ahead at
    distance 0 gives 1 / pi.

    The result is minus the gradient of Khatib's (1986) repulsive potential in the bounded form reach (1 - d / reach)^2
    / 2.
    """
    near = np.maximum(1.0 - range_m / reach_m, 0.0)
    rays = len(angle_rad)
    x = portable.ordered_sum(near * portable.cos(angle_rad))
    y = portable.ordered_sum(near * portable.sin(angle_rad))
    return Vectors(-x / rays, -y / rays)


def low_pass(previous: FloatArray, target: FloatArray, period_s: float, time_constant_s: float) -> FloatArray:
    """Return the low-passed value a period after `previous` (n,), with the input `target` (n,), in their unit.

        y <- y + (u - y) T / (tau + T)

    the first-order lag tau dy/dt = u - y by the backward Euler rule, which is stable for any tau: with tau = 0 the
    value equals the input at once.
    """
    return previous + (target - previous) * (period_s / (time_constant_s + period_s))


def hysteresis(on: BoolArray, value: FloatArray, rises_to: float, falls_to: float) -> BoolArray:
    """Return True for each value that is on, (n,): on from `rises_to` up, off from `falls_to` down, else unchanged.

    A Schmitt trigger, with `falls_to` below `rises_to`, all in the unit of `value` (n,); nan changes nothing.
    """
    return (on | (value >= rises_to)) & ~(value <= falls_to)


def steered(direction: Vectors, speed_mps: float, turn_gain_per_s: float) -> tuple[FloatArray, FloatArray]:
    """Return forward speed in m/s and turn rate in rad/s, (n,) each, for `robots.drive`.

        v = speed_mps max(cos a, 0),    w = turn_gain_per_s a

    with a the angle of the vector: the more a robot has to turn the slower it drives, and it turns on the spot towards
    a vector to its rear. For a vector of length 0 it drives straight on.
    """
    angle = direction.angle_rad
    return speed_mps * np.maximum(portable.cos(angle), 0.0), turn_gain_per_s * angle
