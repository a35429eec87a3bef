"""Bodies block: robots between two others stop the signal of a disk, as with infrared."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np
from numba import njit

from swarmwire.comms.air.links import HEARD, Links
from swarmwire.comms.air.propagation.bodies_between import bodies_between
from swarmwire.comms.air.stages.stage import Medium, Stage
from swarmwire.comms.arrays import BoolArray, FloatArray
from swarmwire.comms.fates import Fate
from swarmwire.comms.geometry import grid


class BodiesBlock(Stage):
    """A link is blocked if the disc of a third robot, dead or alive, covers a point of the line between the centres."""

    name = "bodies_block"
    keys = ("bodies_block",)

    @classmethod
    def of(cls, medium: Medium) -> Stage | None:
        """The stage, where the radio says so and there are bodies."""
        return BodiesBlock(medium) if medium.radio.bodies_block and medium.radius_m.any() else None

    def __init__(self, medium: Medium) -> None:
        assert medium.radio.range_m is not None  # `Air` has refused a disk without
        self._running, self._robots, self._size_m = medium.running, medium.robots, medium.size_m
        self._radius_m, self._range_m = medium.radius_m, medium.radio.range_m

    def decide(self, links: Links, pose: FloatArray) -> None:
        """Blocked links end, and were not in range."""
        ends = self._blocked(links, pose)
        links.fate[ends] = Fate.BLOCKED
        links.in_range[ends] = 0

    def delivery(self, links: Links, pose: FloatArray) -> FloatArray:
        """0 where blocked, else 1."""
        return (~self._blocked(links, pose)).astype(np.float64)

    def _blocked(self, links: Links, pose: FloatArray) -> BoolArray:
        x, y = np.ascontiguousarray(pose[:, 0]), np.ascontiguousarray(pose[:, 1])
        cells = grid.build(x, y, len(self._running), self._size_m, self._range_m, self._running)
        return behind_bodies(x, y, self._radius_m, cells, self._robots, links.sender, links.receiver, links.fate)


@njit(cache=True)
def behind_bodies(x, y, radius_m, cells, robots, sender, receiver, fate):
    """Which of the links under way have a robot between their ends, (k,); equal both ways.

    `x`, `y`, `radius_m` (rows,) in m; `cells` is a `grid.Grid` of x and y with `robots` to each arena.
    """
    ends = np.zeros(len(sender), np.bool_)
    most_radius_m = radius_m.max()
    for i in range(len(ends)):
        if fate[i] == HEARD:
            ends[i] = bodies_between(x, y, radius_m, most_radius_m, cells, robots, sender[i], receiver[i]) > 0
    return ends
