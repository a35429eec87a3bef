"""Deadlock: robots that were told to go, and have not come away."""

# pyright: basic, reportUnknownMemberType=false

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.config import parameter
from swarmwire.comms.geometry.obstacles import to_nearest
from swarmwire.comms.kernels import njit
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure, Metric
from swarmwire.metrics.moment import Moment
from swarmwire.metrics.torus import sides_m


@dataclass(frozen=True)
class Deadlocked(Metric):
    """Robots deadlocked / robots alive, 0 to 1. NaN before `window_s` have passed, and if no robot is alive.

    Our own definition; we know of none that others share. A robot alive is deadlocked if over the last `window_s`

    - it was told to go at least `told_m`: the sum over ticks, while it was alive, of the commanded speed (forward or
      backward, and sideways, within its limits) times the tick's length; and
    - its centre is now less than `moved_m` from where it was `window_s` ago, the shortest way on a torus.

    So who waits, or turns on the spot, is not deadlocked; who pushes against others is, who goes to and fro between
    two, and who drives in circles that small. Nothing is told of why. `told_m` should be well above `moved_m`: a robot
    that was told to go a little is not held back. The window is rounded to whole ticks, at least one.
    """

    window_s: float = parameter(10.0, help="how far it looks back", unit="s", above=0.0, at_most=3600.0)
    moved_m: float = parameter(0.05, help="who came less far from where it was has not come away", unit="m", above=0.0)
    told_m: float = parameter(0.2, help="who was commanded to go at least so far was told to move", unit="m", above=0.0)

    name = "deadlocked"
    help = "robots alive that were told to move over a window and stayed where they were / robots alive"
    bounds = (0.0, 1.0)

    def begin(self, static: Static) -> Measure:
        """A fresh measure; it remembers a window of places."""
        window_ticks = max(round(self.window_s * static.rate_hz), 1)
        rows = static.arenas * static.robots
        then: FloatArray = np.zeros((window_ticks, rows, 3))  # x, y, and the way told up to then
        told_m: FloatArray = np.zeros(rows)
        tick_s, seen = 1.0 / static.rate_hz, 0
        wrap_m = sides_m(static)

        def measure(moment: Moment) -> FloatArray:
            nonlocal seen
            truth, at = moment.truth, then[seen % window_ticks]
            known, seen = seen >= window_ticks, seen + 1
            limits = self.told_m, self.moved_m
            stuck = _step(truth.pose, truth.command, moment.alive, tick_s, wrap_m, limits, told_m, at)
            return stuck / moment.per_robot_alive if known else np.full(static.arenas, np.nan)

        return measure


@njit()
def _step(pose, command, alive, tick_s, wrap_m, limits, told_m, then):
    """How many robots of each arena are deadlocked; puts the present tick in the place of the one a window ago."""
    arenas, robots = alive.shape
    stuck = np.zeros(arenas)
    least_told_m, moved_m = limits
    for arena in range(arenas):
        for i in range(robots):
            row = arena * robots + i
            x, y = pose[row, 0], pose[row, 1]
            along, across = x - then[row, 0], y - then[row, 1]
            along, across = along + to_nearest(along, wrap_m[0]), across + to_nearest(across, wrap_m[1])
            stayed = along * along + across * across < moved_m * moved_m
            if alive[arena, i] and stayed and told_m[row] - then[row, 2] >= least_told_m:
                stuck[arena] += 1.0
            then[row, 0], then[row, 1], then[row, 2] = x, y, told_m[row]
            if alive[arena, i]:
                told_m[row] += np.sqrt(command[row, 0] ** 2 + command[row, 2] ** 2) * tick_s
    return stuck
