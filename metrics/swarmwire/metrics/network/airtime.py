"""Airtime: how much of the time radios are sending."""

# pyright: basic, reportUnknownMemberType=false

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.clock import NS_PER_S
from swarmwire.comms.kernels import njit
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure, Metric
from swarmwire.metrics.moment import Moment


@dataclass(frozen=True)
class Airtime(Metric):
    """Share of the time that a robot's radio has packets on air: mean over the robots alive of airtime / tick.

    A packet counts in the tick in which its end is known, and what of it is longer than a tick in those that follow. Of
    a packet sent again for want of an acknowledgement one try counts, and acknowledgements do not. NaN without a radio,
    or if no robot is alive. What fills the medium around a robot is this times the robots whose signals reach it.
    """

    name = "airtime"
    help = "share of the time that a robot's radio has packets on air, mean over robots alive"
    standard = True
    bounds = (0.0, 1.0)

    def begin(self, static: Static) -> Measure:
        """A fresh measure, which keeps the airtime that is still to be counted."""
        owed_ns: IntArray = np.zeros((static.arenas, static.robots), np.int64)
        tick_ns = NS_PER_S // static.rate_hz

        def measure(moment: Moment) -> FloatArray | float:
            gone = moment.truth.departed
            if gone is None:
                return np.nan
            counted_ns = _counted_ns(
                gone.arena, gone.sender, gone.on_air_at_ns, gone.off_air_at_ns, tick_ns, moment.alive, owed_ns
            )
            return counted_ns / (tick_ns * moment.per_robot_alive)

        return measure


@njit()
def _counted_ns(arena, sender, on_air_at_ns, off_air_at_ns, tick_ns, alive, owed_ns):
    """The airtime that counts in this tick, of robots alive, (arenas,); `owed_ns` is what every robot has left."""
    for i in range(len(arena)):
        owed_ns[arena[i], sender[i]] += off_air_at_ns[i] - on_air_at_ns[i]
    total_ns = np.zeros(len(owed_ns), np.int64)
    for a in range(owed_ns.shape[0]):
        for robot in range(owed_ns.shape[1]):
            counted_ns = min(owed_ns[a, robot], tick_ns)
            owed_ns[a, robot] -= counted_ns
            if alive[a, robot]:
                total_ns[a] += counted_ns
    return total_ns
