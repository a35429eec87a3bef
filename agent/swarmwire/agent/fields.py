"""Vector fields for VectorAgents: from packets and rays to a steering command.

Fields of neighbours give a vector per packet, and `mean_received` averages them per robot. They are Reynolds's three
rules (Flocks, Herds, and Schools, 1987) as primitives of one formula each, with lengths between 0 and 1. Fields of rays
give a vector per robot, away from near objects. `low_pass` and `hysteresis` keep a command from flickering, and
`steered` turns a vector into speeds.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from swarmwire.agent.packet import Packets
from swarmwire.comms.base.arrays import BoolArray, FloatArray
from swarmwire.comms.robot.sensors.rays import ProximityReading


@dataclass(slots=True)  # not frozen: a step makes many of them, and a frozen one takes four times as long
class Vectors:
    """Vectors, each in the frame of its robot, all without a unit, or all in the same unit.

    They can be added, and multiplied by a number or an array: `0.6 * pull - 3.0 * near`.
    """

    x: FloatArray  # ahead, (k,) for packets or (n,) for robots
    y: FloatArray  # to the left

    __array_ufunc__ = None  # so that an array on the left multiplies the vectors as a whole

    @property
    def length(self) -> FloatArray:
        """Lengths."""
        return np.hypot(self.x, self.y)

    @property
    def angle_rad(self) -> FloatArray:
        """Directions in [-pi, pi], 0 ahead, positive to the left; 0 for a vector of no length."""
        return np.arctan2(self.y, self.x)

    def turned(self, by_rad: FloatArray) -> "Vectors":
        """The vectors turned to the left, each by its angle.

        Turned by the robot's heading they are along the axes of the compass, by its negative in the robot's frame.
        """
        cosine, sine = np.cos(by_rad), np.sin(by_rad)
        return Vectors(self.x * cosine - self.y * sine, self.x * sine + self.y * cosine)

    def __add__(self, other: "Vectors") -> "Vectors":
        return Vectors(self.x + other.x, self.y + other.y)

    def __sub__(self, other: "Vectors") -> "Vectors":
        return Vectors(self.x - other.x, self.y - other.y)

    def __mul__(self, weight: float | FloatArray) -> "Vectors":
        return Vectors(weight * self.x, weight * self.y)

    __rmul__ = __mul__


def along(angle_rad: FloatArray) -> Vectors:
    """Vectors of length 1 in these directions."""
    return Vectors(np.cos(angle_rad), np.sin(angle_rad))


def ahead(n: int) -> Vectors:
    """For n robots vectors of length 1 straight ahead."""
    return Vectors(np.ones(n), np.zeros(n))


def attraction(range_m: FloatArray, bearing_rad: FloatArray, rest_m: float) -> Vectors:
    """Towards each neighbour farther than `rest_m`, (k,): min((d - rest_m) / rest_m, 1) long, 0 nearer.

    `range_m` and `bearing_rad` (k,) are those of the packets.
    """
    return np.minimum(np.maximum((range_m - rest_m) / rest_m, 0.0), 1.0) * along(bearing_rad)


def repulsion(range_m: FloatArray, bearing_rad: FloatArray, rest_m: float) -> Vectors:
    """Away from each neighbour nearer than `rest_m`, (k,): (rest_m - d) / rest_m long, 0 farther."""
    return np.minimum((range_m - rest_m) / rest_m, 0.0) * along(bearing_rad)


def spacing(range_m: FloatArray, bearing_rad: FloatArray, rest_m: float) -> Vectors:
    """Towards each neighbour farther than `rest_m` and away from each nearer: attraction and repulsion in one, (k,)."""
    return np.minimum((range_m - rest_m) / rest_m, 1.0) * along(bearing_rad)


def alignment(their_heading_rad: FloatArray, own_heading_rad: FloatArray) -> Vectors:
    """The direction in which each neighbour heads, (k,), of length 1; both headings (k,) by compasses that agree.

    For received packets, `own_heading_rad` is `heading_rad[received.row]`.
    """
    return along(their_heading_rad - own_heading_rad)


def mean_received(received: Packets[Any], of: Vectors) -> Vectors:
    """The mean of vectors (k,) over the packets that each robot received, (n,); length 0 without packets."""
    packets = np.maximum(received.count(), 1)
    return Vectors(received.sum(of.x) / packets, received.sum(of.y) / packets)


def repulsion_of_rays(proximity: ProximityReading[Any]) -> Vectors:
    """Away from objects in the rays of `proximity`, (n,): minus the sum of the rays' vectors, each `value` long.

    A `value` is 0 to 1: a ray that touches an object has length 1, a ray that sees none has length 0.
    """
    x, y = proximity.vector_sum()
    return Vectors(-x, -y)


def repulsion_of_ranges(range_m: FloatArray, angle_rad: FloatArray, reach_m: float) -> Vectors:
    """Away from objects nearer than `reach_m`, (n,): minus the mean of the rays' vectors, each 1 - d / reach_m long.

    `range_m` (n, rays) is inf or more than `reach_m` where a ray sees nothing, `angle_rad` (rays,) is its direction, as
    in a laser scan. As a mean over all rays it does not depend on their number; a wall that fills the half ahead at
    distance 0 gives 1 / pi.

    It is minus the gradient of Khatib's (1986) repulsive potential in the bounded form reach (1 - d / reach)^2 / 2.
    """
    near = np.maximum(1.0 - range_m / reach_m, 0.0)
    rays = len(angle_rad)
    x, y = np.add.reduce(near * np.cos(angle_rad), 1), np.add.reduce(near * np.sin(angle_rad), 1)
    return Vectors(-x / rays, -y / rays)


def low_pass(before: FloatArray, wanted: FloatArray, period_s: float, time_constant_s: float) -> FloatArray:
    """The low-passed value a period after `before` (n,), with the input `wanted` (n,), in their unit.

        y <- y + (u - y) T / (tau + T)

    the first-order lag tau dy/dt = u - y by the backward Euler rule, which is stable for any tau: with tau = 0 the
    value equals the input at once.
    """
    return before + (wanted - before) * (period_s / (time_constant_s + period_s))


def hysteresis(on: BoolArray, value: FloatArray, rises_to: float, falls_to: float) -> BoolArray:
    """Whether each is on, (n,): on at `rises_to` or more, off at `falls_to` or less, unchanged in between.

    Schmitt's trigger, with `falls_to` below `rises_to`, all in the unit of `value` (n,); nan changes nothing.
    """
    return (on | (value >= rises_to)) & ~(value <= falls_to)


def steered(wanted: Vectors, speed_mps: float, turn_gain_per_s: float) -> tuple[FloatArray, FloatArray]:
    """Forward speed in m/s and turn rate in rad/s, (n,) each, for `robots.drive`.

        v = speed_mps max(cos a, 0),    w = turn_gain_per_s a

    with a the angle of the vector: the more a robot has to turn the slower it drives, and it turns on the spot towards
    a vector to its rear. For a vector of length 0 it drives straight on.
    """
    angle = wanted.angle_rad
    return speed_mps * np.maximum(np.cos(angle), 0.0), turn_gain_per_s * angle
