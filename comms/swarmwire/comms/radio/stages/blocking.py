"""Stages that block links: line of sight, bodies of robots, and disruption.

Disruption ends links to dead robots, to radios that are off, and across partitions.
"""

from typing import Any

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.comms.base.geometry.line_of_sight import is_blocked
from swarmwire.comms.base.geometry.robot_index import grid_over, sort
from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.links import Links
from swarmwire.comms.radio.propagation.obstruction import bodies_between
from swarmwire.comms.radio.stages.stage import Stage
from swarmwire.comms.robot.packets import Fate


class LineOfSight(Stage):
    """A link is blocked if an obstacle touches the straight line between the centres of sender and receiver."""

    name = "line_of_sight"
    keys = ("line_of_sight",)

    @classmethod
    def create(cls, context: ChannelContext) -> "LineOfSight | None":
        """Return the stage if the radio needs a line of sight and there are obstacles."""
        return LineOfSight(context) if context.radio.needs_line_of_sight and context.obstacles.count else None

    def __init__(self, context: ChannelContext) -> None:
        self._obstacles, self._robots, self._wrap_m = context.obstacles, context.robots, context.wrap_m

    def decide(self, links: Links, pose: FloatArray) -> None:
        """End blocked links, which were not in range."""
        _end_blocked(links, self.blocked(pose, links.sender, links.receiver))

    def delivery(self, links: Links, pose: FloatArray) -> FloatArray:
        """Return 0 for blocked links, else 1."""
        return (~self.blocked(pose, links.sender, links.receiver)).astype(np.float64)

    def blocked(self, pose: FloatArray, a: IntArray, b: IntArray) -> BoolArray:
        """Return True where an obstacle blocks the line between robot rows, (k,)."""
        blocked = np.empty(len(a), np.bool_)
        _block(blocked, self._obstacles.now(), self._robots, *self._wrap_m, pose, a, b)
        return blocked


def _end_blocked(links: Links, is_blocked: BoolArray) -> None:
    links.fate[is_blocked] = Fate.BLOCKED
    links.in_range[is_blocked] = 0


@kernel(from_python=True)
def _block(
    blocked: AnyArray,
    obstacles: Any,
    robots: int,
    wrap_x: float,
    wrap_y: float,
    pose: AnyArray,
    sender: AnyArray,
    receiver: AnyArray,
):
    for i in range(len(blocked)):
        # From the lower row to the higher, so that both directions of a link agree to the last bit.
        a, b = min(sender[i], receiver[i]), max(sender[i], receiver[i])
        ax, ay, bx, by = pose[a, 0], pose[a, 1], pose[b, 0], pose[b, 1]
        blocked[i] = is_blocked(obstacles, a // robots, ax, ay, bx, by, wrap_x, wrap_y)


class BodiesBlock(Stage):
    """A link is blocked if the disc of a third robot, dead or alive, covers a point of the line between the centres.

    For the unit disk only, as with infrared.
    """

    name = "bodies_block"
    keys = ("bodies_block",)

    @classmethod
    def create(cls, context: ChannelContext) -> Stage | None:
        """Return the stage if `bodies_block` is set and robots have bodies."""
        return BodiesBlock(context) if context.radio.bodies_block and context.radius_m.any() else None

    def __init__(self, context: ChannelContext) -> None:
        assert context.radio.range_m is not None  # `RadioMedium` refuses a unit disk without a range
        self._running, self._robots, self._radius_m = context.running, context.robots, context.radius_m
        arenas, rows = len(context.keys), len(context.radius_m)
        self._grid = grid_over(context.size_m, context.radio.range_m, arenas, rows, clamps=True)

    def decide(self, links: Links, pose: FloatArray) -> None:
        """End blocked links, which were not in range."""
        _end_blocked(links, self._blocked(links, pose))

    def delivery(self, links: Links, pose: FloatArray) -> FloatArray:
        """Return 0 for blocked links, else 1."""
        return (~self._blocked(links, pose)).astype(np.float64)

    def _blocked(self, links: Links, pose: FloatArray) -> BoolArray:
        x, y = np.ascontiguousarray(pose[:, 0]), np.ascontiguousarray(pose[:, 1])
        sort(self._grid, pose.reshape(len(self._running), self._robots, pose.shape[1]), self._running)
        return bodies_between(x, y, self._radius_m, self._grid, self._robots, links.sender, links.receiver) > 0


class Disrupted(Stage):
    """Ends links by the active disruption. They stay in range, which depends on path loss and walls alone."""

    name = "disrupted"
    keys = ()  # events set it

    @classmethod
    def create(cls, context: ChannelContext) -> Stage | None:
        """Return the stage; every radio has it, since events may come."""
        return Disrupted(context)

    def __init__(self, context: ChannelContext) -> None:
        self._disruption = context.disruption

    def decide(self, links: Links, pose: FloatArray) -> None:
        """End links by `Disruption.end_links`."""
        self._disruption.end_links(links.fate, links.sender, links.receiver)

    @property
    def passes_all(self) -> bool:
        """True if no disruption is active."""
        return not self._disruption.is_active

    def delivery(self, links: Links, pose: FloatArray) -> FloatArray:
        """Return 0 if a radio is off or a partition separates the two, else 1; the graph excludes dead robots."""
        return self._disruption.connects(links.sender, links.receiver).astype(np.float64)
