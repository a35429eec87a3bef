"""Stages that block links: line of sight, bodies of robots, and disruption.

Disruption ends links to dead robots, to radios that are off, and across partitions.
"""

from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.comms.base.geometry.line_of_sight import is_blocked
from swarmwire.comms.base.geometry.obstacle_index import ObstacleIndex
from swarmwire.comms.base.geometry.robot_index import grid_over, sort
from swarmwire.comms.base.kernels import kernel, njit
from swarmwire.comms.base.sentinels import UNDER_WAY
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.propagation.obstruction import BodyParams, bodies_on_line
from swarmwire.comms.radio.stages.stage import Stage
from swarmwire.comms.robot.packets import Fate

PARTITIONED, BLACKOUT, RECEIVER_DEAD = int(Fate.PARTITIONED), int(Fate.BLACKOUT), int(Fate.RECEIVER_DEAD)


class SightParams(NamedTuple):
    """Parameters of `is_out_of_sight`."""

    obstacles: ObstacleIndex
    robots: int
    wrap_m: tuple[float, float]


@kernel()
def is_out_of_sight(params: Any, pose: AnyArray, sender: int, receiver: int):
    """Return True if an obstacle blocks the line between two robot rows."""
    if params is None:
        return False
    # From the lower row to the higher, so that both directions of a link agree to the last bit.
    a, b = min(sender, receiver), max(sender, receiver)
    ax, ay, az, bx, by, bz = pose[a, 0], pose[a, 1], pose[a, 3], pose[b, 0], pose[b, 1], pose[b, 3]
    wrap_x, wrap_y = params.wrap_m
    return is_blocked(params.obstacles, a // params.robots, ax, ay, az, bx, by, bz, wrap_x, wrap_y)


class LineOfSight(Stage):
    """A link is blocked if an obstacle touches the straight line between the antennas of sender and receiver.

    The line is in space: an obstacle is in its way only where the line is below the obstacle's top.
    """

    name = "line_of_sight"
    keys = ("line_of_sight",)

    @classmethod
    def create(cls, context: ChannelContext) -> "LineOfSight | None":
        """Return the stage if the radio needs a line of sight and there are obstacles."""
        return LineOfSight(context) if context.radio.needs_line_of_sight and context.obstacles.count else None

    def __init__(self, context: ChannelContext) -> None:
        self._obstacles, self._robots, self._wrap_m = context.obstacles, context.robots, context.wrap_m

    def params(self, pose: FloatArray) -> SightParams:
        """Return the input of the kernel."""
        return SightParams(self._obstacles.now(), self._robots, self._wrap_m)

    def delivery(self, sender: IntArray, receiver: IntArray, pose: FloatArray) -> FloatArray:
        """Return 0 for blocked links, else 1."""
        return (~self.blocked(pose, sender, receiver)).astype(np.float64)

    def blocked(self, pose: FloatArray, a: IntArray, b: IntArray) -> BoolArray:
        """Return True where an obstacle blocks the line between robot rows, (k,)."""
        return _are_out_of_sight(self.params(pose), pose, a, b)


@njit()
def _are_out_of_sight(params: Any, pose: AnyArray, a: AnyArray, b: AnyArray):
    blocked = np.empty(len(a), np.bool_)
    for i in range(len(a)):
        blocked[i] = is_out_of_sight(params, pose, a[i], b[i])
    return blocked


@kernel()
def is_behind_bodies(params: Any, sender: int, receiver: int):
    """Return True if the body of a third robot covers a point of the line between two robot rows."""
    if params is None:
        return False
    return bodies_on_line(params, min(sender, receiver), max(sender, receiver)) > 0


class BodiesBlock(Stage):
    """A link is blocked if the body of a third robot, dead or alive, covers a point of the line between the antennas.

    The line is in space, and the body is a cylinder whose lower side is at its robot's height. For the unit disk only,
    as with infrared.
    """

    name = "bodies_block"
    keys = ("bodies_block",)

    @classmethod
    def create(cls, context: ChannelContext) -> "BodiesBlock | None":
        """Return the stage if `bodies_block` is set and robots have bodies."""
        return BodiesBlock(context) if context.radio.bodies_block and context.radius_m.any() else None

    def __init__(self, context: ChannelContext) -> None:
        assert context.radio.range_m is not None  # `RadioMedium` refuses a unit disk without a range
        self._running, self._robots = context.running, context.robots
        self._radius_m, self._height_m = context.radius_m, context.height_m
        arenas, rows = len(context.keys), len(context.radius_m)
        self._grid = grid_over(context.size_m, context.radio.range_m, arenas, rows, clamps=True)
        self._max_radius_m = float(context.radius_m.max())

    def params(self, pose: FloatArray) -> BodyParams:
        """Return the input of the kernel for robots at `pose` (rows, 4)."""
        x, y, z = (np.ascontiguousarray(pose[:, column]) for column in (0, 1, 3))
        sort(self._grid, pose.reshape(len(self._running), self._robots, pose.shape[1]), self._running)
        shape = self._radius_m, self._height_m, self._max_radius_m
        return BodyParams(x, y, z, *shape, self._grid, self._robots)

    def delivery(self, sender: IntArray, receiver: IntArray, pose: FloatArray) -> FloatArray:
        """Return 0 for blocked links, else 1."""
        return _past_bodies(self.params(pose), sender, receiver)


@njit()
def _past_bodies(params: Any, a: AnyArray, b: AnyArray):
    passes = np.empty(len(a))
    for i in range(len(a)):
        passes[i] = 0.0 if is_behind_bodies(params, a[i], b[i]) else 1.0
    return passes


@kernel()
def disrupted_fate(cuts: Any, sender: int, receiver: int):
    """Return the fate by the active disruption: RECEIVER_DEAD before BLACKOUT before PARTITIONED; else UNDER_WAY.

    Senders that are dead or off end packets at their queue.
    """
    if not cuts.alive[receiver]:
        return RECEIVER_DEAD
    if not cuts.radio_on[receiver]:
        return BLACKOUT
    for k in range(len(cuts.sides)):
        a, b = cuts.sides[k, sender], cuts.sides[k, receiver]
        if a != b and a > 0 and b > 0:
            return PARTITIONED
    for k in range(len(cuts.one_way)):
        if cuts.one_way[k, sender] == 1 and cuts.one_way[k, receiver] == 2:
            return PARTITIONED
    return UNDER_WAY


@kernel(from_python=True)
def end_disrupted(cuts: Any, fate: AnyArray, sender: AnyArray, receiver: AnyArray):
    """Set the fates (k,) of links between robot rows that are UNDER_WAY and that the disruption ends; in place."""
    for i in range(len(fate)):
        if fate[i] == UNDER_WAY:
            fate[i] = disrupted_fate(cuts, sender[i], receiver[i])


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

    @property
    def passes_all(self) -> bool:
        """True if no disruption is active."""
        return not self._disruption.is_active

    def delivery(self, sender: IntArray, receiver: IntArray, pose: FloatArray) -> FloatArray:
        """Return 0 if a radio is off or a partition separates the two, else 1; the graph excludes dead robots."""
        return self._disruption.connects(sender, receiver).astype(np.float64)
