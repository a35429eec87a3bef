"""What rays around a body see in four sectors of 90 degrees, and in their halves."""

from dataclasses import dataclass, replace

import numpy as np

from swarmwire.agent.readings import InfraredReading, ProximityReading
from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray

LEFT, STRAIGHT, RIGHT = 1, 0, -1
EITHER = 2  # a side that is still to be drawn
FRONT_RAD, REAR_RAD = 0.25 * np.pi, 0.75 * np.pi  # half width of the front; where the rear begins, to either side
AXIS = 1e-9  # sine of an angle: nearer to the axis a ray is in neither half


@dataclass(frozen=True)
class Sectors:
    """The rays of n robots by sector, each with its border towards the left.

    Answers are compared, not distances: an answer is the greater the nearer a thing is, and is there already.

    Attributes:
        answer: (rays, n) 0 for nothing, 1 for touching. A row per ray: of few rays of many robots the most is found
            many times as fast so, and is as exact.
        front, left, rear, right: (rays,) which rays look there.
        left_half, right_half: (rays,) which look to either side of the body's axis.
    """

    answer: FloatArray
    front: BoolArray
    left: BoolArray
    rear: BoolArray
    right: BoolArray
    left_half: BoolArray
    right_half: BoolArray

    @classmethod
    def of(cls, reading: ProximityReading[FloatArray] | InfraredReading[FloatArray]) -> "Sectors":
        """The sectors of the rays of a sense."""
        angle_rad = reading.angle_rad
        front = (angle_rad > -FRONT_RAD) & (angle_rad <= FRONT_RAD)
        left = (angle_rad > FRONT_RAD) & (angle_rad <= REAR_RAD)
        right = (angle_rad > -REAR_RAD) & (angle_rad <= -FRONT_RAD)
        across = np.sin(angle_rad)
        answer = np.ascontiguousarray(reading.value.T)
        return cls(answer, front, left, ~(front | left | right), right, across > AXIS, across < -AXIS)

    def weaker_than(self, answer: float) -> "Sectors":
        """The same, but that rays see nothing which answer as much as this or more: what is farther alone."""
        return replace(self, answer=np.where(self.answer < answer, self.answer, 0.0))

    def strongest(self, rays: BoolArray) -> FloatArray:
        """The greatest answer of these rays, (n,); 0 without such rays."""
        return np.max(self.answer[rays], axis=0, initial=0.0)

    def count(self, rays: BoolArray) -> IntArray:
        """How many of these rays see anything, (n,)."""
        return np.count_nonzero(self.answer[rays], axis=0)

    def nearer_half(self, rays: BoolArray) -> IntArray:
        """LEFT or RIGHT, the half of these rays in which something is nearest, (n,); EITHER where it is in both."""
        return self._half(rays, LEFT, RIGHT)

    def farther_half(self, rays: BoolArray) -> IntArray:
        """The other one, (n,)."""
        return self._half(rays, RIGHT, LEFT)

    def _half(self, rays: BoolArray, if_left: int, if_right: int) -> IntArray:
        left, right = self.strongest(rays & self.left_half), self.strongest(rays & self.right_half)
        return np.where(left > right, if_left, np.where(right > left, if_right, EITHER))
