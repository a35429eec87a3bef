"""Oscillation: how often robots change the side to which they turn."""

# pyright: basic, reportUnknownMemberType=false

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.config import parameter
from swarmwire.comms.kernels import njit
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure, Metric
from swarmwire.metrics.moment import Moment


@dataclass(frozen=True)
class Oscillation(Metric):
    """Changes of turning side so far / robot-minutes alive so far, in 1/min; NaN while nobody was alive.

    A robot changes sides when the turning rate that is commanded, within its limits, is beyond `dead_band_radps` to one
    side, and the last that was beyond it, however long ago, was to the other. Going straight in between is no change.
    Robots alive are added up over time; a robot that died has no side when it lives again. `final` is the rate of the
    run. Once a tick is the most: 60 times the tick rate.

    Our own definition of the dithering that thresholds bring about. A robot that wanders changes sides, too: compare
    rules in one setting.
    """

    dead_band_radps: float = parameter(0.05, help="slower turns have no side", unit="rad/s", at_least=0.0)

    name = "oscillation"
    help = "changes of the commanded turning side per robot-minute so far, in 1/min"
    unit = "1/min"
    bounds = (0.0, None)

    def begin(self, static: Static) -> Measure:
        """A fresh measure."""
        side: IntArray = np.zeros(static.arenas * static.robots, np.int64)
        changes, robot_ticks = np.zeros(static.arenas, np.int64), np.zeros(static.arenas, np.int64)
        ticks_per_min = static.rate_hz * 60.0

        def measure(moment: Moment) -> FloatArray:
            _count_changes(moment.truth.command, moment.alive, self.dead_band_radps, side, changes)
            np.add(robot_ticks, moment.robots_alive, out=robot_ticks)
            robot_min = np.where(robot_ticks > 0, robot_ticks / ticks_per_min, np.nan)
            return changes / robot_min

        return measure


@njit()
def _count_changes(command, alive, dead_band_radps, side, changes):
    """Add this tick's changes of each arena to `changes`, and note each robot's `side`: 1 left, -1 right, 0 none."""
    arenas, robots = alive.shape
    for arena in range(arenas):
        for i in range(robots):
            row = arena * robots + i
            turn = command[row, 1]
            if not alive[arena, i]:
                side[row] = 0
            elif abs(turn) > dead_band_radps:
                now = 1 if turn > 0.0 else -1
                changes[arena] += side[row] == -now
                side[row] = now
