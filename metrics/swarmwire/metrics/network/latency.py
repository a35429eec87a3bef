"""Latency: how late packets are of late, on air and to the agent."""

# pyright: basic, reportUnknownMemberType=false

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.clock import NS_PER_S
from swarmwire.comms.kernels import njit
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure
from swarmwire.metrics.moment import Moment
from swarmwire.metrics.network.latencies import Latencies
from swarmwire.metrics.network.windowed import OfWindow, Window


class _Latency(OfWindow):
    """A mean in s over the packets received that became known in the last `window_s`, a broadcast once per receiver.

    What a latency is, `metrics/network/latencies.py` says; percentiles over the run stand in the summary's `radio`. 0
    or more; NaN without a radio, or if nothing was received in the window.
    """

    unit = "s"
    bounds = (0.0, None)

    @abstractmethod
    def pick(self, air_ns: IntArray, agent_ns: IntArray) -> IntArray:
        """The latency that is meant."""

    def begin(self, static: Static) -> Measure:
        """A fresh measure, which keeps the sums of the window's ticks."""
        window, latencies = Window(static, self.window_s, 2), Latencies(static)

        def measure(moment: Moment) -> FloatArray | float:
            finished = moment.truth.finished
            if finished is None:
                return np.nan
            arena, air_ns, agent_ns = latencies.of(finished, moment.truth.tick)
            total_ns, received = window.add(_sums(arena, self.pick(air_ns, agent_ns), static.arenas))
            return total_ns / np.where(received > 0, received * NS_PER_S, np.nan)

        return measure


@njit()
def _sums(arena, latency_ns, arenas):
    """Of each arena the sum of its packets' latencies, and how many they are, (2, arenas)."""
    sums = np.zeros((2, arenas), np.int64)
    for i in range(len(arena)):
        sums[0, arena[i]] += latency_ns[i]
        sums[1, arena[i]] += 1
    return sums


@dataclass(frozen=True)
class LatencyOnAir(_Latency):
    """Mean latency on air: received_at - sent_at."""

    name = "latency_air"
    help = "time from sending to hearing, mean over packets received in the last window_s, in s"

    def pick(self, air_ns: IntArray, agent_ns: IntArray) -> IntArray:
        """Until it was received."""
        return air_ns


@dataclass(frozen=True)
class LatencyToAgent(_Latency):
    """Mean latency to the agent: start of the first tick at which the receiver acts and has it - sent_at."""

    name = "latency_agent"
    help = "time from sending to the receiver's next tick to act, mean over packets received in the last window_s, in s"

    def pick(self, air_ns: IntArray, agent_ns: IntArray) -> IntArray:
        """Until its receiver acts."""
        return agent_ns
