"""Delivery of packets: PDR and link PDR over a window of ticks, throughput and airtime."""

from abc import abstractmethod
from dataclasses import dataclass
from math import ceil
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from swarmwire.comms.base.arrays import AnyArray, FloatArray, IntArray
from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.base.config import parameter
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.observe.truth import Static
from swarmwire.comms.radio.records import PacketCounts, ReceptionRecords
from swarmwire.comms.robot.packets import Fate
from swarmwire.metrics.measures.metric import Measure, Metric, TickView

ROUNDING = 1e-9  # fraction of a tick
BITS_PER_BYTE = 8
RECEIVED = int(Fate.RECEIVED)


class ReceptionColumns(NamedTuple):
    """Columns of `ReceptionRecords` for kernels, (k,) each."""

    arena: IntArray
    sender: IntArray
    receiver: IntArray
    fate: IntArray
    sent_at_ns: IntArray
    final_at_ns: IntArray
    size_bytes: IntArray


def reception_columns(records: ReceptionRecords) -> ReceptionColumns:
    """Return the columns of the links that kernels read."""
    return ReceptionColumns(
        records.arena,
        records.sender,
        records.receiver,
        records.fate,
        records.sent_at_ns,
        records.final_at_ns,
        records.size_bytes,
    )


@dataclass(frozen=True)
class WindowedMetric(Metric):
    """A metric of the packets in a window of time that ends now."""

    needs = ("packets",)

    window_s: float = parameter(
        1.0, help="length of the window; rounded up to whole ticks", unit="s", above=0.0, at_most=86_400.0
    )


class Window:
    """Sums of whole numbers per arena over the last ticks: exact, however long the run."""

    def __init__(self, static: Static, window_s: float, numbers: int) -> None:
        """Start with zeros; each tick has this many `numbers` per arena."""
        ticks = max(1, ceil(window_s * static.rate_hz - ROUNDING))
        self._ring: IntArray = np.zeros((ticks, numbers, static.arenas), np.int64)
        self._sum: IntArray = np.zeros((numbers, static.arenas), np.int64)
        self._oldest = 0

    def add(self, numbers: ArrayLike) -> IntArray:
        """Add a tick's numbers (numbers, arenas); return their sums over the window up to it (same shape)."""
        oldest = self._ring[self._oldest]
        self._sum -= oldest
        oldest[:] = numbers
        self._sum += oldest
        self._oldest = (self._oldest + 1) % len(self._ring)
        return self._sum


class _DeliveryRatio(WindowedMetric):
    """Receivers that received / a count of receivers, of the fates that became final in the window."""

    def begin(self, static: Static) -> Measure:
        """Return a measure that keeps the counts of the window's ticks."""
        window = Window(static, self.window_s, 2)

        def measure(view: TickView) -> FloatArray | float:
            tally = view.truth.tally
            if tally is None:
                return np.nan
            received, receivers = window.add((tally.fates[:, Fate.RECEIVED], self._receivers(tally)))
            return received / np.where(receivers > 0, receivers, np.nan)

        return measure

    @abstractmethod
    def _receivers(self, tally: PacketCounts) -> IntArray:
        """Return the denominator of the ratio, (arenas,)."""


@dataclass(frozen=True)
class PacketDeliveryRatio(_DeliveryRatio):
    """Receivers that received / intended receivers, of the fates that became final in the last `window_s`.

    Every fate counts, so receivers out of range lower the ratio. `link_pdr` counts only receivers in range. A loss
    becomes final sooner than a reception, by the radio's latency, so the ratio dips as traffic sets in and rises as it
    ends. The ratio over the whole run is `radio.pdr` of the summary; the mean of this metric over the ticks differs,
    since each tick has the same weight, however many packets it has. From 0 to 1; NaN without a radio, or if no fate
    became final in the window.
    """

    name = "pdr"
    help = "packet delivery ratio: received / intended receivers, of the fates that became final in the last window_s"
    bounds = (0.0, 1.0)

    def _receivers(self, tally: PacketCounts) -> IntArray:
        return tally.fates.sum(axis=1)


@dataclass(frozen=True)
class LinkPacketDeliveryRatio(_DeliveryRatio):
    """Receivers that received / receivers in range, of the fates that became final in the last `window_s`.

    In range after path loss and walls, as in `PacketCounts.in_range`: dead and blacked-out receivers count. With
    independent losses of probability p the ratio is 1 - p, with K tries 1 - p^K. A loss becomes final sooner than a
    reception, by the radio's latency, so the ratio dips as traffic sets in and rises as it ends. The ratio over the
    whole run is `radio.link_pdr` of the summary; the mean of this metric over the ticks differs, since each tick has
    the same weight, however many packets it has. From 0 to 1; NaN without a radio, or if no fate of a receiver in
    range became final in the window.
    """

    name = "link_pdr"
    help = "PDR of links: received / receivers in range, of the fates that became final in the last window_s"
    bounds = (0.0, 1.0)

    def _receivers(self, tally: PacketCounts) -> IntArray:
        return tally.in_range


@dataclass(frozen=True)
class Throughput(Metric):
    """Payload received, over all receivers of the arena: sum of 8 x bytes since the last tick x tick rate, in bit/s.

    A broadcast counts once for each robot that receives it; the message's tag counts, the radio's overhead does not.
    The mean over the ticks divided by the robots is the throughput of a receiver. NaN without a radio.
    """

    name = "throughput"
    help = "payload received by all robots together, a broadcast once for each, in bit/s"
    unit = "bit/s"
    standard = True
    needs = ("packets",)
    bounds = (0.0, None)

    def begin(self, static: Static) -> Measure:
        """Return a measure without memory."""
        return _throughput_bps


def _throughput_bps(view: TickView) -> FloatArray | float:
    static, ended = view.static, view.truth.finished
    if ended is None:
        return np.nan
    return _received_bytes(reception_columns(ended), static.arenas) * (BITS_PER_BYTE * static.rate_hz)


@njit()
def _received_bytes(links: Any, arenas: int):
    total = np.zeros(arenas)
    for i in range(len(links.fate)):
        if links.fate[i] == RECEIVED:
            total[links.arena[i]] += links.size_bytes[i]
    return total


@dataclass(frozen=True)
class Airtime(Metric):
    """Share of the time that a robot's radio has packets on air: mean over the robots alive of airtime / tick.

    A packet counts in the tick in which its end is known; airtime beyond a tick counts in the following ones. One
    attempt of a retransmitted packet counts; acknowledgements do not. NaN without a radio, or if no robot is alive. The
    load of the channel at a robot is this value times the robots whose signals reach it.
    """

    name = "airtime"
    help = "share of the time that a robot's radio has packets on air, mean over robots alive"
    standard = True
    needs = ("airtime",)
    bounds = (0.0, 1.0)

    def begin(self, static: Static) -> Measure:
        """Return a measure that keeps the airtime of each robot that is not counted yet."""
        pending_ns: IntArray = np.zeros((static.arenas, static.robots), np.int64)
        tick_ns = NS_PER_S // static.rate_hz

        def measure(view: TickView) -> FloatArray | float:
            packets = view.truth.departed
            if packets is None:
                return np.nan
            _add_airtime(packets.arena, packets.sender, packets.off_air_at_ns - packets.on_air_at_ns, pending_ns)
            return _pop_airtime(tick_ns, view.alive, pending_ns) / (tick_ns * view.per_robot_alive)

        return measure


@njit()
def _add_airtime(arena: AnyArray, sender: AnyArray, airtime_ns: AnyArray, pending_ns: AnyArray):
    for i in range(len(arena)):
        pending_ns[arena[i], sender[i]] += airtime_ns[i]


@njit()
def _pop_airtime(tick_ns: int, alive: AnyArray, pending_ns: AnyArray):
    """Subtract at most a tick from each robot's `pending_ns`; return the sum over robots alive, (arenas,)."""
    total_ns = np.zeros(len(pending_ns), np.int64)
    for arena in range(pending_ns.shape[0]):
        for robot in range(pending_ns.shape[1]):
            counted_ns = min(pending_ns[arena, robot], tick_ns)
            pending_ns[arena, robot] -= counted_ns
            if alive[arena, robot]:
                total_ns[arena] += counted_ns
    return total_ns
