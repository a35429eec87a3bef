"""Line of sight: obstacles block the signal."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np
from numba import njit

from swarmwire.comms.air.links import HEARD, Links
from swarmwire.comms.air.stages.stage import Medium, Stage
from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.fates import Fate
from swarmwire.comms.geometry.obstacles import is_blocked, is_blocked_on


class LineOfSight(Stage):
    """A link is blocked if an obstacle touches the straight line between the centres of sender and receiver."""

    name = "line_of_sight"
    keys = ("line_of_sight",)

    @classmethod
    def of(cls, medium: Medium) -> Stage | None:
        """The stage, where the radio needs a line of sight and there are obstacles."""
        any_obstacle = len(medium.obstacles.circle) or len(medium.obstacles.polygon)
        return LineOfSight(medium) if medium.radio.needs_line_of_sight and any_obstacle else None

    def __init__(self, medium: Medium) -> None:
        self._obstacles, self._robots, self._wrap_m = medium.obstacles, medium.robots, medium.wrap_m

    def decide(self, links: Links, pose: FloatArray) -> None:
        """Blocked links end, and were not in range."""
        ends = blocked(self._obstacles, self._robots, self._wrap_m, pose, links.sender, links.receiver, links.fate)
        links.fate[ends] = Fate.BLOCKED
        links.in_range[ends] = 0

    def delivery(self, links: Links, pose: FloatArray) -> FloatArray:
        """0 where blocked, else 1."""
        ends = blocked(self._obstacles, self._robots, self._wrap_m, pose, links.sender, links.receiver, links.fate)
        return (~ends).astype(np.float64)


@njit(cache=True)
def blocked(obstacles, robots, wrap_m, pose, sender, receiver, fate):
    """Which of the links under way an obstacle blocks, (k,)."""
    ends = np.zeros(len(sender), np.bool_)
    wraps = wrap_m[0] > 0.0
    for i in range(len(ends)):
        # From the lower row to the higher: both directions of a link then agree to the last bit.
        a, b = min(sender[i], receiver[i]), max(sender[i], receiver[i])
        if fate[i] != HEARD:
            continue
        ax, ay, bx, by = pose[a, 0], pose[a, 1], pose[b, 0], pose[b, 1]
        if wraps:
            ends[i] = is_blocked_on(obstacles, a // robots, ax, ay, bx, by, *wrap_m)
        else:
            ends[i] = is_blocked(obstacles, a // robots, ax, ay, bx, by)
    return ends
