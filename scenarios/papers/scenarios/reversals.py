"""Reversals: how often robots change between driving forward and backward."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.config import parameter
from swarmwire.comms.observe.truth import Static
from swarmwire.metrics.measures.metric import Measure, Metric, TickView


@dataclass(frozen=True)
class Reversals(Metric):
    """Changes between forward and backward so far / robot-minutes alive so far, in 1/min; NaN while nobody was alive.

    As `oscillation` counts changes of the turning side: by the speed that is commanded, beyond `dead_band_mps` either
    way, against the last that was beyond it. The article's threshold rule turns to one side alone, so that what it
    does to and fro shows here.
    """

    dead_band_mps: float = parameter(0.01, help="slower ways have no direction", unit="m/s", at_least=0.0)

    name = "reversals"
    help = "changes of the commanded direction of driving per robot-minute so far, in 1/min"
    unit = "1/min"
    bounds = (0.0, None)

    def begin(self, static: Static) -> Measure:
        """A fresh measure."""
        way = np.zeros((static.arenas, static.robots))
        changes, robot_ticks = np.zeros(static.arenas), np.zeros(static.arenas)
        ticks_per_min = static.rate_hz * 60.0

        def measure(view: TickView) -> FloatArray:
            forward = view.truth.command[:, 0].reshape(way.shape)
            now = np.where(np.abs(forward) > self.dead_band_mps, np.sign(forward), way) * view.alive
            np.add(changes, np.count_nonzero(now * way < 0.0, axis=1), out=changes)
            np.add(robot_ticks, view.robots_alive, out=robot_ticks)
            way[...] = now
            robot_min = np.where(robot_ticks > 0, robot_ticks / ticks_per_min, np.nan)
            return changes / robot_min

        return measure
