"""Vectors: a field's answer, one vector for each packet or robot."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from swarmwire.agent.packet import Packets
from swarmwire.agent.readings import ProximityReading
from swarmwire.comms.arrays import BoolArray, FloatArray


@dataclass(slots=True)  # not frozen, which would make each of the many that a step adds up take four times as long
class Vectors:
    """Vectors in the frame of the robot each belongs to, all without a unit, or all in the same one.

    They add up, and a number or an array weighs them: `0.6 * pull - 3.0 * near`.
    """

    x: FloatArray  # ahead, (k,) for packets or (n,) for robots
    y: FloatArray  # to the left

    __array_ufunc__ = None  # so that an array on the left weighs the vectors, not each element for itself

    @property
    def length(self) -> FloatArray:
        """How long they are."""
        return np.hypot(self.x, self.y)

    @property
    def angle_rad(self) -> FloatArray:
        """Where they point, in [-pi, pi], 0 ahead, positive to the left; 0 for a vector of no length."""
        return np.arctan2(self.y, self.x)

    def turned(self, by_rad: FloatArray) -> "Vectors":
        """The same turned to the left, by an angle for each.

        By the robot's heading they are along the axes of the compass, by its negative they are back in its frame.
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


# --- Fields of neighbours that were received: a vector for each packet, and their mean over the packets of a robot.
#
# The three rules are Reynolds's (Flocks, Herds, and Schools, 1987) as primitives of one formula each. All their vectors
# are between 0 and 1 long.


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
    """Where each neighbour is heading, (k,), of length 1; both headings (k,) by compasses that agree.

    Of packets received the receiver's own is `heading_rad[received.row]`.
    """
    return along(their_heading_rad - own_heading_rad)


def mean_received(received: Packets[Any], of: Vectors) -> Vectors:
    """The mean of vectors (k,) over the packets that each robot received, (n,); no length for who received nothing."""
    packets = np.maximum(received.count(), 1)
    return Vectors(received.sum(of.x) / packets, received.sum(of.y) / packets)


# --- Fields of what rays see: a vector for each robot, away from what is near.


def repulsion_of_rays(proximity: ProximityReading[Any]) -> Vectors:
    """Away from what the rays of `proximity` see, (n,): minus the sum of the rays' vectors, each `value` (0 to 1) long.

    One that sees a thing at touching distance is a vector of length 1; what is far adds nothing.
    """
    x, y = proximity.vector_sum()
    return Vectors(-x, -y)


def repulsion_of_ranges(range_m: FloatArray, angle_rad: FloatArray, reach_m: float) -> Vectors:
    """Away from what is nearer than `reach_m`, (n,): minus the mean of the rays' vectors, each 1 - d / reach_m long.

    `range_m` (n, rays) is inf or more than `reach_m` where a ray sees nothing, `angle_rad` (rays,) is where it looks,
    as a laser scan has them. As a mean over all rays it is the same for a scanner with more of them; a wall that
    fills the half ahead at distance 0 gives 1 / pi.

    It is minus the gradient of Khatib's (1986) repulsive potential in the bounded form reach (1 - d / reach)^2 / 2.
    """
    near = np.maximum(1.0 - range_m / reach_m, 0.0)
    rays = len(angle_rad)
    x, y = np.add.reduce(near * np.cos(angle_rad), 1), np.add.reduce(near * np.sin(angle_rad), 1)
    return Vectors(-x / rays, -y / rays)


# --- What keeps a command from flickering: a low-pass and a hysteresis, per robot.


def low_pass(before: FloatArray, wanted: FloatArray, period_s: float, time_constant_s: float) -> FloatArray:
    """What `before` (n,) has become a period later on its way to `wanted` (n,), in their unit.

        y <- y + (u - y) T / (tau + T)

    the first-order lag tau dy/dt = u - y by the backward Euler rule, so that no tau is too short for the period: with
    tau = 0 it is at once what is wanted.
    """
    return before + (wanted - before) * (period_s / (time_constant_s + period_s))


def hysteresis(on: BoolArray, value: FloatArray, rises_to: float, falls_to: float) -> BoolArray:
    """Whether each is on, (n,): goes on at `rises_to` or more, off at `falls_to` or less, stays as it was in between.

    Schmitt's trigger, with `falls_to` below `rises_to`, all in the unit of `value` (n,); nan changes nothing.
    """
    return (on | (value >= rises_to)) & ~(value <= falls_to)


# --- From the vector that a robot wants to follow to how it drives.


def steered(wanted: Vectors, speed_mps: float, turn_gain_per_s: float) -> tuple[FloatArray, FloatArray]:
    """Forward speed in m/s and turn rate in rad/s, (n,) each, for `robots.drive`.

        v = speed_mps max(cos a, 0),    w = turn_gain_per_s a

    with a the angle to what is wanted: the more a robot has to turn the slower it drives, and what is behind it it
    turns to on the spot. Where nothing is wanted it drives straight on.
    """
    angle = wanted.angle_rad
    return speed_mps * np.maximum(np.cos(angle), 0.0), turn_gain_per_s * angle
