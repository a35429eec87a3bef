"""Latency: how late packets are of late, on air and to the agent."""

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.clock import NS_PER_S
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure
from swarmwire.metrics.moment import Moment
from swarmwire.metrics.network.latencies import Latencies
from swarmwire.metrics.network.windowed import OfWindow, Window


class _Latency(OfWindow):
    """A mean in s over the packets heard that became known in the last `window_s`, a broadcast once per receiver.

    What a latency is, `metrics/network/latencies.py` says; percentiles over the run stand in the summary's `radio`. 0
    or more; NaN without a radio, or if nothing was heard in the window.
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
            total_ns, heard = np.zeros((2, static.arenas), np.int64)
            np.add.at(total_ns, arena, self.pick(air_ns, agent_ns))
            np.add.at(heard, arena, 1)
            total_ns, heard = window.add((total_ns, heard))
            return total_ns / np.where(heard > 0, heard * NS_PER_S, np.nan)

        return measure


@dataclass(frozen=True)
class LatencyOnAir(_Latency):
    """Mean latency on air: heard_at - sent_at."""

    name = "latency_air"
    help = "time from sending to hearing, mean over the packets heard in the last window_s, in s"

    def pick(self, air_ns: IntArray, agent_ns: IntArray) -> IntArray:
        """Until it was heard."""
        return air_ns


@dataclass(frozen=True)
class LatencyToAgent(_Latency):
    """Mean latency to the agent: start of the first tick at which the receiver acts and has it - sent_at."""

    name = "latency_agent"
    help = (
        "time from sending to the receiver's next tick to act, mean over the packets heard in the last window_s, in s"
    )

    def pick(self, air_ns: IntArray, agent_ns: IntArray) -> IntArray:
        """Until its receiver acts."""
        return agent_ns
