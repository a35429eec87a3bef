"""Throughput: how much of what was sent arrives."""

# pyright: basic, reportUnknownMemberType=false

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.kernels import njit
from swarmwire.comms.packets import Fate
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure, Metric
from swarmwire.metrics.moment import Moment

BITS_PER_BYTE = 8
RECEIVED = int(Fate.RECEIVED)


@dataclass(frozen=True)
class Throughput(Metric):
    """Payload received, over all receivers of the arena: sum of 8 x bytes since the last tick x tick rate, in bit/s.

    A broadcast counts once for each robot that hears it; the message's tag counts, what the radio adds to it does not.
    The mean over the ticks divided by the robots is that of a receiver. NaN without a radio.
    """

    name = "throughput"
    help = "payload received by all robots together, a broadcast once for each, in bit/s"
    unit = "bit/s"
    standard = True
    bounds = (0.0, None)

    def begin(self, static: Static) -> Measure:
        """A fresh measure; nothing is remembered."""
        return _throughput_bps


def _throughput_bps(moment: Moment) -> FloatArray | float:
    static, ended = moment.static, moment.truth.finished
    if ended is None:
        return np.nan
    return _received_bytes(ended.fate, ended.arena, ended.size_bytes, static.arenas) * (BITS_PER_BYTE * static.rate_hz)


@njit()
def _received_bytes(fate, arena, size_bytes, arenas):
    total = np.zeros(arenas)
    for i in range(len(fate)):
        if fate[i] == RECEIVED:
            total[arena[i]] += size_bytes[i]
    return total
