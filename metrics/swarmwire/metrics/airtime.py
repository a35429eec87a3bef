"""Airtime: how much of the time radios are sending."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.clock import NS_PER_S
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure, Metric
from swarmwire.metrics.moment import Moment


@dataclass(frozen=True)
class Airtime(Metric):
    """Share of the time that a robot's radio has packets on air: mean over the robots alive of airtime / tick.

    A packet counts in the tick in which its end is known, and what of it is longer than a tick in those that follow. Of
    a packet sent again for want of an acknowledgement one try counts, and acknowledgements do not. NaN without a radio,
    or if no robot is alive. What fills the air around a robot is this times the robots whose signals reach it.
    """

    name = "airtime"
    help = "share of the time that a robot's radio has packets on air, mean over robots alive"
    bounds = (0.0, 1.0)

    def begin(self, static: Static) -> Measure:
        """A fresh measure, which keeps the airtime that is still to be counted."""
        owed_ns: IntArray = np.zeros((static.arenas, static.robots), np.int64)
        tick_ns = NS_PER_S // static.rate_hz

        def measure(moment: Moment) -> FloatArray:
            departed = moment.truth.departed
            if departed is None:
                return np.full(static.arenas, np.nan)
            lasted_ns = departed.off_air_at_ns - departed.on_air_at_ns
            np.add.at(owed_ns.reshape(-1), departed.arena * static.robots + departed.sender, lasted_ns)
            counted_ns = np.minimum(owed_ns, tick_ns)
            owed_ns[:] -= counted_ns
            alive = np.where(moment.robots_alive > 0, moment.robots_alive, np.nan)
            return np.sum(counted_ns, axis=1, where=moment.alive) / (tick_ns * alive)

        return measure
