"""Airtime: how much of the time radios are sending."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.clock import NS_PER_S
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure, Metric
from swarmwire.metrics.moment import Moment


@dataclass(frozen=True)
class Airtime(Metric):
    """Share of the time that a robot's radio has packets on air: mean over the robots alive of airtime / tick.

    A packet counts whole in the tick in which its end is known: a tick may have more than 1 where packets last longer
    than ticks; the mean over the ticks has not. Of a packet sent again for want of an acknowledgement one try counts,
    and acknowledgements do not. NaN without a radio, or if no robot is alive. What fills the air around a robot is this
    times the robots whose signals reach it.
    """

    name = "airtime"
    help = "share of the time that a robot's radio has packets on air, mean over robots alive"
    bounds = (0.0, None)

    def begin(self, static: Static) -> Measure:
        """A fresh measure; nothing is remembered."""
        return _share_on_air


def _share_on_air(moment: Moment) -> FloatArray:
    static, departed = moment.static, moment.truth.departed
    if departed is None:
        return np.full(static.arenas, np.nan)
    on_air_ns = np.bincount(departed.arena, departed.off_air_at_ns - departed.on_air_at_ns, static.arenas)
    alive = np.where(moment.robots_alive > 0, moment.robots_alive, np.nan)
    return on_air_ns * static.rate_hz / (NS_PER_S * alive)
