"""Vectors: a field's answer, one vector for each packet or robot."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray


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
