"""Motion of single robots: changes of turning side, detours and deadlocks."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, FloatArray, IntArray
from swarmwire.comms.base.config import parameter
from swarmwire.comms.base.geometry.obstacles import to_nearest
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.observe.truth import Static
from swarmwire.metrics.measures.metric import Measure, Metric, TickView
from swarmwire.metrics.measures.torus import sides_m


@dataclass(frozen=True)
class Oscillation(Metric):
    """Changes of turning side so far / robot-minutes alive so far, in 1/min; NaN while no robot was alive.

    A robot changes sides when its commanded turning rate, within its limits, exceeds `dead_band_radps` to one side, and
    the last rate beyond the dead band, however long ago, was to the other. Going straight in between is no change.
    Robots alive are added up over time; a robot that died has no side when it lives again. `final` is the rate of the
    run. The largest value, a change in each tick, is 60 times the tick rate.

    Our definition of the dithering that thresholds cause. A robot that wanders changes sides, too: compare rules in one
    setting.
    """

    dead_band_radps: float = parameter(0.05, help="slower turns have no side", unit="rad/s", at_least=0.0)

    name = "oscillation"
    help = "changes of the commanded turning side per robot-minute so far, in 1/min"
    unit = "1/min"
    needs = ("commands",)
    bounds = (0.0, None)

    def begin(self, static: Static) -> Measure:
        """Return a measure that keeps each robot's side and the counts."""
        side: IntArray = np.zeros(static.arenas * static.robots, np.int64)
        changes, robot_ticks = np.zeros(static.arenas, np.int64), np.zeros(static.arenas, np.int64)
        ticks_per_min = static.rate_hz * 60.0

        def measure(view: TickView) -> FloatArray:
            _count_changes(view.truth.command, view.alive, self.dead_band_radps, side, changes)
            np.add(robot_ticks, view.robots_alive, out=robot_ticks)
            robot_min = np.where(robot_ticks > 0, robot_ticks / ticks_per_min, np.nan)
            return changes / robot_min

        return measure


@njit()
def _count_changes(command: AnyArray, alive: AnyArray, dead_band_radps: Any, side: AnyArray, changes: AnyArray):
    """Add this tick's changes of each arena to `changes`; update each robot's `side`: 1 left, -1 right, 0 none."""
    arenas, robots = alive.shape
    for arena in range(arenas):
        for i in range(robots):
            row = arena * robots + i
            turn = command[row, 1]
            if not alive[arena, i]:
                side[row] = 0
            elif abs(turn) > dead_band_radps:
                new = 1 if turn > 0.0 else -1
                changes[arena] += side[row] == -new
                side[row] = new


@dataclass(frozen=True)
class PathEfficiency(Metric):
    """Mean over the robots alive that moved of |x(t) - x(0)| / length of the path from x(0) to x(t), 0 to 1.

    1 for robots that went straight, 0 for robots that are back at their start. A robot moved if its path is at least
    `moved_m` long: this excludes robots that tremble on the spot. Paths are sums of the shortest displacements from
    tick to tick, and on a torus x is unrolled: a full turn is a displacement of one side. The path of a robot that was
    pushed while dead counts once it is alive again. NaN while no robot alive has moved.

    A random walk has sqrt(pi / (4 n)) after n steps of equal length, n large: it falls over the run.

    Source: the straightness index of E. Batschelet, Circular Statistics in Biology (1981).
    """

    moved_m: float = parameter(0.01, help="who has a shorter path has not moved", unit="m", above=0.0)

    name = "path_efficiency"
    help = "net displacement / path length since the start, mean over robots alive that moved"
    bounds = (0.0, 1.0)

    def begin(self, static: Static) -> Measure:
        """Return a measure that keeps each robot's position, displacement and path."""
        before: FloatArray | None = None
        path_m: FloatArray = np.zeros((static.arenas * static.robots, 3))  # displacement in x and y, path length
        wrap_m = sides_m(static)

        def measure(view: TickView) -> FloatArray:
            nonlocal before
            pose = view.truth.pose
            if before is None:
                before = pose[:, :2].copy()
            return _add_step(pose, view.alive, wrap_m, self.moved_m, before, path_m)

        return measure


@njit()
def _add_step(
    pose: AnyArray, alive: AnyArray, wrap_m: tuple[float, float], moved_m: float, before: AnyArray, path_m: AnyArray
):
    """Add the step from `before` to `path_m`, set `before` to the positions, and return the mean of each arena."""
    arenas, robots = alive.shape
    mean = np.full(arenas, np.nan)
    for arena in range(arenas):
        total, n = 0.0, 0
        for i in range(robots):
            row = arena * robots + i
            along, across = pose[row, 0] - before[row, 0], pose[row, 1] - before[row, 1]
            along, across = along + to_nearest(along, wrap_m[0]), across + to_nearest(across, wrap_m[1])
            before[row, 0], before[row, 1] = pose[row, 0], pose[row, 1]
            path_m[row, 0] += along
            path_m[row, 1] += across
            path_m[row, 2] += np.sqrt(along * along + across * across)
            if alive[arena, i] and path_m[row, 2] >= moved_m:
                net_m = np.sqrt(path_m[row, 0] ** 2 + path_m[row, 1] ** 2)
                total += min(net_m / path_m[row, 2], 1.0)  # rounding may exceed 1
                n += 1
        if n:
            mean[arena] = total / n
    return mean


@dataclass(frozen=True)
class Deadlocked(Metric):
    """Robots deadlocked / robots alive, 0 to 1. NaN before `window_s` have passed, and if no robot is alive.

    Our definition; there is no common one. A robot alive is deadlocked if over the last `window_s`

    - it was commanded to go at least `told_m`: the sum over ticks, while it was alive, of the commanded speed (forward
      or backward, and sideways, within its limits) times the tick's length; and
    - its centre is now less than `moved_m` from its position `window_s` ago, the shortest way on a torus.

    A robot that waits, or turns on the spot, is not deadlocked. A robot that pushes against others, oscillates between
    two, or drives in small circles is, for any reason. `told_m` should be well above `moved_m`, since a short
    commanded path alone shows no obstruction. The window is rounded to whole ticks, at least one.
    """

    window_s: float = parameter(10.0, help="how far it looks back", unit="s", above=0.0, at_most=3600.0)
    moved_m: float = parameter(0.05, help="who came less far from where it was has not come away", unit="m", above=0.0)
    told_m: float = parameter(
        0.2, help="commanded path over the window from which a robot counts as commanded to move", unit="m", above=0.0
    )

    name = "deadlocked"
    help = "robots alive that were commanded to move over a window and did not / robots alive"
    needs = ("poses", "commands")
    bounds = (0.0, 1.0)

    def begin(self, static: Static) -> Measure:
        """Return a measure that keeps the positions and commanded paths of a window of ticks."""
        window_ticks = max(round(self.window_s * static.rate_hz), 1)
        rows = static.arenas * static.robots
        ring: FloatArray = np.zeros((window_ticks, rows, 3))  # x, y, and the commanded path up to that tick
        commanded_m: FloatArray = np.zeros(rows)
        limits = _DeadlockLimits(self.told_m, self.moved_m, 1.0 / static.rate_hz, sides_m(static))
        ticks = 0

        def measure(view: TickView) -> FloatArray:
            nonlocal ticks
            truth, slot = view.truth, ring[ticks % window_ticks]
            is_full, ticks = ticks >= window_ticks, ticks + 1
            stuck = _count_stuck(truth.pose, truth.command, view.alive, limits, commanded_m, slot)
            return stuck / view.per_robot_alive if is_full else np.full(static.arenas, np.nan)

        return measure


class _DeadlockLimits(NamedTuple):
    commanded_m: float
    moved_m: float
    tick_s: float
    wrap_m: tuple[float, float]


@njit()
def _count_stuck(
    pose: AnyArray, command: AnyArray, alive: AnyArray, limits: Any, commanded_m: AnyArray, slot: AnyArray
):
    """Count the deadlocked robots of each arena; overwrite `slot`, the tick a window ago, with the present tick."""
    arenas, robots = alive.shape
    stuck = np.zeros(arenas)
    min_commanded_m, moved_m, tick_s, wrap_m = limits
    for arena in range(arenas):
        for i in range(robots):
            row = arena * robots + i
            x, y = pose[row, 0], pose[row, 1]
            along, across = x - slot[row, 0], y - slot[row, 1]
            along, across = along + to_nearest(along, wrap_m[0]), across + to_nearest(across, wrap_m[1])
            stayed = along * along + across * across < moved_m * moved_m
            if alive[arena, i] and stayed and commanded_m[row] - slot[row, 2] >= min_commanded_m:
                stuck[arena] += 1.0
            slot[row, 0], slot[row, 1], slot[row, 2] = x, y, commanded_m[row]
            if alive[arena, i]:
                commanded_m[row] += np.sqrt(command[row, 0] ** 2 + command[row, 2] ** 2) * tick_s
    return stuck
