"""Latencies of packets on air and to the agent, and the radio's part of the summary: fates, ratios, percentiles."""

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, FloatArray, IntArray
from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Static, Truth
from swarmwire.comms.radio.records import PacketCounts, ReceptionRecords
from swarmwire.comms.robot.packets import FATE_NAMES, Fate
from swarmwire.metrics.measures.metric import Measure, TickView
from swarmwire.metrics.measures.network.delivery import Window, WindowedMetric, reception_columns
from swarmwire.metrics.text import json_number

RECEIVED = int(Fate.RECEIVED)
RELATIVE_ERROR = 0.005
LARGEST_NS = 10**14  # a little more than a day; longer durations count as this
# Bin 0 counts zeros, bin b + 1 values in (g^(b-1), g^b]; 2 g^b / (g + 1) is within (g - 1) / (g + 1) of all of them.
_GROWTH = (1.0 + RELATIVE_ERROR) / (1.0 - RELATIVE_ERROR)
_LOG_GROWTH = math.log(_GROWTH)
_BINS = 2 + math.ceil(math.log(LARGEST_NS) / _LOG_GROWTH)
PERCENTS = (50.0, 90.0, 99.0)


class Latencies:
    """Computes the two latencies of each received packet.

    On air: from sending to reception. To the agent: from sending to the start of the first tick at which the receiver
    acts, from the tick that reports the reception on.
    """

    def __init__(self, static: Static) -> None:
        self._rate_hz, self._act_every_ticks = static.rate_hz, static.act_every_ticks

    def measure(self, finished: ReceptionRecords, tick: int) -> tuple[IntArray, IntArray, IntArray]:
        """Return arena, latency on air and latency to the agent in ns of the packets received in a tick, (k,) each."""
        return _latencies_ns(reception_columns(finished), tick, self._act_every_ticks, self._rate_hz)


def acts_at_ns(tick: int | IntArray, act_every_ticks: IntArray, rate_hz: int) -> IntArray:
    """Return the start of the first tick, from `tick` on, at which each agent acts, (k,)."""
    return -(-tick // act_every_ticks) * act_every_ticks * NS_PER_S // rate_hz


_acts_at_ns = njit()(acts_at_ns)


@njit()
def _latencies_ns(links: Any, tick: int, act_every_ticks: AnyArray, rate_hz: int):
    """Return arena, time from sending to reception, and to the receiver's next step, of the links received, (k,)."""
    n = len(links.fate)
    arena, air_ns, agent_ns = np.empty(n, np.int64), np.empty(n, np.int64), np.empty(n, np.int64)
    k = 0
    for i in range(n):
        if links.fate[i] == RECEIVED:
            sent_at_ns = links.sent_at_ns[i]
            arena[k], air_ns[k] = links.arena[i], links.final_at_ns[i] - sent_at_ns
            agent_ns[k] = _acts_at_ns(tick, act_every_ticks[links.receiver[i]], rate_hz) - sent_at_ns
            k += 1
    return arena[:k], air_ns[:k], agent_ns[:k]


class _Latency(WindowedMetric):
    """A mean in s over the packets received in the last `window_s`, a broadcast once per receiver.

    Percentiles over the run are in the summary's `radio`. 0 or more; NaN without a radio, or if nothing was received in
    the window.
    """

    unit = "s"
    bounds = (0.0, None)
    to_agent: ClassVar[bool]  # False: on air

    def begin(self, static: Static) -> Measure:
        """Return a measure that keeps the sums of the window's ticks."""
        window, latencies = Window(static, self.window_s, 2), Latencies(static)

        def measure(view: TickView) -> FloatArray | float:
            finished = view.truth.finished
            if finished is None:
                return np.nan
            arena, air_ns, agent_ns = latencies.measure(finished, view.truth.tick)
            total_ns, received = window.add(_sums(arena, agent_ns if self.to_agent else air_ns, static.arenas))
            return total_ns / np.where(received > 0, received * NS_PER_S, np.nan)

        return measure


@njit()
def _sums(arena: AnyArray, latency_ns: AnyArray, arenas: int):
    """Return the sum of the latencies and the number of packets of each arena, (2, arenas)."""
    sums = np.zeros((2, arenas), np.int64)
    for i in range(len(arena)):
        sums[0, arena[i]] += latency_ns[i]
        sums[1, arena[i]] += 1
    return sums


@dataclass(frozen=True)
class LatencyOnAir(_Latency):
    """Mean latency on air: received_at - sent_at."""

    name = "latency_air"
    to_agent = False
    needs = ("packets", "latency")
    help = "time from sending to hearing, mean over packets received in the last window_s, in s"


@dataclass(frozen=True)
class LatencyToAgent(_Latency):
    """Mean latency to the agent: start of the first tick at which the receiver acts on the packet - sent_at."""

    name = "latency_agent"
    to_agent = True
    help = "time from sending to the receiver's next tick to act, mean over packets received in the last window_s, in s"


class LogHistogram:
    """Durations in ns, counted per arena; 26 kB an arena.

    Percentiles are those of the nearest rank (numpy's "inverted_cdf"), within a relative error of 0.5 % for 1 ns to
    10^14 ns. Durations below zero count as zero.

    Source: C. Masson, J. Rim, H. Lee, DDSketch: a fast and fully-mergeable quantile sketch with relative-error
    guarantees, PVLDB 12 (2019), section 2.
    """

    def __init__(self, arenas: int) -> None:
        """Start with an empty histogram for each arena."""
        self._count: IntArray = np.zeros((arenas, _BINS), np.int64)

    def add(self, arena: IntArray, duration_ns: IntArray) -> None:
        """Count durations (k,), each in its arena (k,)."""
        _count_durations(self._count, arena, duration_ns)

    def percentiles_ns(self, arena: int, percents: tuple[float, ...]) -> FloatArray:
        """Return the percentiles in ns, one for each of `percents` (0 to 100); NaN of an empty histogram."""
        running = np.cumsum(self._count[arena])
        if running[-1] == 0:
            return np.full(len(percents), np.nan)
        share = np.array(percents, np.float64) / 100.0
        rank: FloatArray = np.maximum(np.ceil(share * running[-1]), 1.0)
        bins: IntArray = np.array([running.searchsorted(r) for r in rank], np.int64)
        return np.where(bins > 0, 2.0 * np.power(_GROWTH, bins - 1.0) / (_GROWTH + 1.0), 0.0)


@njit()
def _count_durations(count: AnyArray, arena: AnyArray, duration_ns: AnyArray):
    last_ns, b = 0, 0
    for i in range(len(duration_ns)):
        if duration_ns[i] != last_ns:  # receivers of a packet often share a duration: this saves logarithms
            last_ns, b = duration_ns[i], 0
            if last_ns > 0:
                b = math.ceil(math.log(min(last_ns, LARGEST_NS)) / _LOG_GROWTH) + 1
        count[arena[i], b] += 1


class RadioTally(Observer):
    """Observer that adds up the radio's tallies. Summary part: `radio`, per arena; nothing without a radio.

    sent (packets), intended and in_range (receivers), fates {name: receivers}, pdr = received / intended, link_pdr =
    received / in_range (null without any such receiver), and of the packets received the p50, p90 and p99 of two
    latencies in s, within 0.5 % (null if none was received): latency_air_s from sending to reception, latency_agent_s
    from sending to the first tick at which the receiver acts.
    """

    def begin(self, static: Static) -> None:
        """Start a run."""
        arenas = static.arenas
        self._has_radio = False
        self._latencies = Latencies(static)
        self._sent = np.zeros(arenas, np.int64)
        self._intended = np.zeros(arenas, np.int64)
        self._in_range = np.zeros(arenas, np.int64)
        self._fates = np.zeros((arenas, len(FATE_NAMES)), np.int64)
        self._air = LogHistogram(arenas)
        self._agent = LogHistogram(arenas)

    def see(self, truth: Truth) -> None:
        """Add the counts and latencies of a tick."""
        if truth.tally is not None:
            self._add(truth.tally)
        if truth.finished is not None:
            self._add_latencies(truth.finished, truth.tick)

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """Return the summary part; with `last`, the packets still under way, the fates add up to intended."""
        if last is not None:
            self._add(last)
        return {"radio": [self._arena(arena) for arena in range(len(self._sent))]} if self._has_radio else {}

    def _add(self, tally: PacketCounts) -> None:
        self._has_radio = True
        self._sent += tally.sent
        self._intended += tally.intended
        self._in_range += tally.in_range
        self._fates += tally.fates

    def _add_latencies(self, finished: ReceptionRecords, tick: int) -> None:
        arena, air_ns, agent_ns = self._latencies.measure(finished, tick)
        self._air.add(arena, air_ns)
        self._agent.add(arena, agent_ns)

    def _arena(self, arena: int) -> dict[str, Any]:
        fates = [int(count) for count in self._fates[arena]]
        received, intended, in_range = fates[Fate.RECEIVED], int(self._intended[arena]), int(self._in_range[arena])
        return {
            "sent": int(self._sent[arena]),
            "intended": intended,
            "in_range": in_range,
            "fates": dict(zip(FATE_NAMES, fates, strict=True)),
            "pdr": received / intended if intended else None,
            "link_pdr": received / in_range if in_range else None,
            "latency_air_s": _percentiles_s(self._air, arena),
            "latency_agent_s": _percentiles_s(self._agent, arena),
        }


def _percentiles_s(histogram: LogHistogram, arena: int) -> dict[str, float | None]:
    durations_ns = histogram.percentiles_ns(arena, PERCENTS)
    return {f"p{percent:g}": json_number(ns / NS_PER_S) for percent, ns in zip(PERCENTS, durations_ns, strict=True)}
