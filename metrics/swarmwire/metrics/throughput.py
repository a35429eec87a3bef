"""Throughput: how much of what was sent arrives."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.fates import Fate
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure, Metric
from swarmwire.metrics.moment import Moment

BITS_PER_BYTE = 8


@dataclass(frozen=True)
class Throughput(Metric):
    """Payload heard, over all receivers of the arena: sum of 8 x bytes heard since the last tick x tick rate, in bit/s.

    A broadcast counts once for each robot that hears it; the message's tag counts, what the radio adds to it does not.
    The mean over the ticks divided by the robots is that of a receiver. NaN without a radio.
    """

    name = "throughput"
    help = "payload heard by all robots together, a broadcast once for each, in bit/s"
    unit = "bit/s"
    bounds = (0.0, None)

    def begin(self, static: Static) -> Measure:
        """A fresh measure; nothing is remembered."""
        return _throughput_bps


def _throughput_bps(moment: Moment) -> FloatArray:
    static, ended = moment.static, moment.truth.finished
    if ended is None:
        return np.full(static.arenas, np.nan)
    heard_bytes = np.bincount(ended.arena, np.where(ended.fate == Fate.HEARD, ended.size_bytes, 0), static.arenas)
    return np.asarray(heard_bytes, np.float64) * (BITS_PER_BYTE * static.rate_hz)
