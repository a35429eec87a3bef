"""Age of information: the age of the newest packet between two robots, and its peak before an update."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.observe.truth import Static
from swarmwire.comms.radio.records import ReceptionRecords
from swarmwire.comms.robot.packets import Fate
from swarmwire.metrics.measures.metric import Measure, Metric, TickView
from swarmwire.metrics.measures.network.delivery import Window, WindowedMetric, reception_columns

MAX_PAIRS = 2**18  # per arena: 2 MB
NEVER = NOT_COUNTED = -1
RECEIVED = int(Fate.RECEIVED)


@dataclass(frozen=True)
class AgeOfInformation(Metric):
    """Mean over pairs (receiver, sender) of t - u in s: t the tick's start, u the sending time of the newest packet.

    A pair counts if both robots are alive and the receiver has ever received a packet of the sender, in range now or
    not. NaN while there is no such pair. A packet that a newer one overtook changes nothing. Memory is 8 bytes for each
    pair of an arena; with more than 512 robots only every n-th counts as a receiver, n = ceil(robots^2 / 2^18), so that
    the memory is 2 MB at most.

    Source: S. Kaul, R. Yates, M. Gruteser, Real-time status: how often should one update?, IEEE INFOCOM 2012, section
    II.
    """

    name = "age_of_information"
    help = (
        "age of the newest packet that a robot received from another, mean over pairs that ever received, in s; pairs "
        "that are out of reach now age on"
    )
    unit = "s"
    standard = True
    needs = ("packets",)
    bounds = (0.0, None)

    def begin(self, static: Static) -> Measure:
        """Return a measure that keeps the sending time of the newest packet of each pair."""
        newest = NewestPackets(static)

        def measure(view: TickView) -> FloatArray | float:
            if view.truth.finished is None:
                return np.nan
            newest.see(view.truth.finished, view.alive)
            return newest.mean_age_s(view.truth.time_ns)

        return measure


@dataclass(frozen=True)
class PeakAgeOfInformation(WindowedMetric):
    """Mean over updates in the last `window_s` of t - u: t the reception of a newer packet, u the last sending time.

    The age of a pair falls with each update; its value just before is its peak. A first packet has no peak, and a
    packet that a newer one overtook is no update. Pairs are those of `age_of_information`. NaN without an update.

    Source: M. Costa, M. Codreanu, A. Ephremides, On the age of information in status update systems with packet
    management, IEEE Transactions on Information Theory 62(4), 2016.
    """

    name = "peak_age_of_information"
    help = "age of what a robot knew of another before a newer packet came, mean over such updates in the window, in s"
    unit = "s"
    needs = ("packets",)
    bounds = (0.0, None)

    def begin(self, static: Static) -> Measure:
        """Return a measure that keeps the sending time of the newest packet of each pair, and the window's ticks."""
        slot, newest_ns = _pair_table(static)
        window = Window(static, self.window_s, 2)

        def measure(view: TickView) -> FloatArray | float:
            ended = view.truth.finished
            if ended is None:
                return np.nan
            peaks = np.zeros((2, static.arenas), np.int64)
            by_time = np.argsort(ended.final_at_ns, kind="stable")
            _add_peaks(by_time, reception_columns(ended), slot, newest_ns, peaks)
            total_ns, updates = window.add(peaks)
            return total_ns / np.where(updates > 0, updates * NS_PER_S, np.nan)

        return measure


@njit()
def _add_peaks(by_time: AnyArray, links: Any, slot: AnyArray, newest_ns: AnyArray, peaks: AnyArray):
    """Record the packets received; add the sum of the peaks in ns and their number to `peaks`, (2, arenas)."""
    for i in by_time:
        if links.fate[i] != RECEIVED or slot[links.receiver[i]] == NOT_COUNTED:
            continue
        a, s, r = links.arena[i], links.sender[i], slot[links.receiver[i]]
        before_ns = newest_ns[a, s, r]
        if links.sent_at_ns[i] > before_ns:
            newest_ns[a, s, r] = links.sent_at_ns[i]
            if before_ns != NEVER:
                peaks[0, a] += links.final_at_ns[i] - before_ns
                peaks[1, a] += 1


def _pair_table(static: Static) -> tuple[IntArray, IntArray]:
    """Return the receiver's slot of each robot (robots,), and the sending times, NEVER, (arenas, robots, receivers).

    The sender is the earlier axis, since the links of a packet are consecutive rows: they write to nearby elements.
    """
    stride = -(-static.robots * static.robots // MAX_PAIRS)  # robots from one receiver to the next
    index = np.arange(static.robots)
    slot = np.where(index % stride == 0, index // stride, NOT_COUNTED)
    return slot, np.full((static.arenas, static.robots, -(-static.robots // stride)), NEVER, np.int64)


class NewestPackets:
    """Sending time of the newest packet of each pair, with the sum over pairs of robots alive, in ns."""

    def __init__(self, static: Static) -> None:
        arenas, robots = static.arenas, static.robots
        self._slot, self._sent_at_ns = _pair_table(static)
        self._alive: BoolArray = np.ones((arenas, robots), np.bool_)
        self._pairs: IntArray = np.zeros(arenas, np.int64)
        self._total_ns = [0] * arenas  # Python integers: a day of a million pairs exceeds 64 bits

    def see(self, ended: ReceptionRecords, alive: BoolArray) -> None:
        """Record the packets received; `alive` (arenas, robots) are the robots that count from now on."""
        gained_ns = np.zeros(len(self._pairs), np.int64)
        _record(reception_columns(ended), self._slot, alive, self._sent_at_ns, self._pairs, gained_ns)
        if not np.array_equal(alive, self._alive):
            self._alive = alive.copy()
            self._recount()
            return
        self._total_ns = [total + gain for total, gain in zip(self._total_ns, gained_ns.tolist(), strict=True)]

    def mean_age_s(self, now_ns: int) -> FloatArray:
        """Return the mean over the pairs that count, (arenas,); NaN without such a pair."""
        ages_s = [
            (now_ns * pairs - total) / (pairs * NS_PER_S) if pairs else np.nan
            for pairs, total in zip(self._pairs.tolist(), self._total_ns, strict=True)
        ]
        return np.array(ages_s, np.float64)

    def _recount(self) -> None:
        counts = self._sent_at_ns != NEVER
        counts &= self._alive[:, :, None] & self._alive[:, None, self._slot != NOT_COUNTED]
        self._pairs = np.count_nonzero(counts, axis=(1, 2))
        by_sender_ns = np.sum(self._sent_at_ns, axis=2, where=counts)
        self._total_ns = [sum(times_ns) for times_ns in by_sender_ns.tolist()]


@njit()
def _record(links: Any, slot: AnyArray, alive: AnyArray, newest_ns: AnyArray, pairs: AnyArray, gained_ns: AnyArray):
    """Record the packets received; add to the counted `pairs` (arenas,) and to the sum of their sending times."""
    for i in range(len(links.fate)):
        if links.fate[i] != RECEIVED or slot[links.receiver[i]] == NOT_COUNTED:
            continue
        a, r, s = links.arena[i], links.receiver[i], links.sender[i]
        before_ns, sent_at_ns = newest_ns[a, s, slot[r]], links.sent_at_ns[i]
        if sent_at_ns <= before_ns:
            continue
        newest_ns[a, s, slot[r]] = sent_at_ns
        if alive[a, r] and alive[a, s]:
            pairs[a] += before_ns == NEVER
            gained_ns[a] += sent_at_ns - (0 if before_ns == NEVER else before_ns)
