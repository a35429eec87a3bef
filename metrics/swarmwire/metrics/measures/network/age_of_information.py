"""Age of information: how old the newest is that robots know of one another, and how old it gets before an update."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.observe.truth import Static
from swarmwire.comms.radio.records import ReceptionRecords
from swarmwire.comms.robot.packets import Fate
from swarmwire.metrics.measures.metric import Measure, Metric, TickView
from swarmwire.metrics.measures.network.delivery import OfWindow, Window

MAX_PAIRS = 2**18  # of an arena: 2 MB
NEVER = NOT_COUNTED = -1
RECEIVED = int(Fate.RECEIVED)


@dataclass(frozen=True)
class AgeOfInformation(Metric):
    """Mean over pairs (receiver, sender) of t - u: t the tick's start, u when the newest one received was sent, in s.

    The pairs are those of robots alive of which the receiver has ever received the sender, in range now or not; who
    never received of a robot knows nothing of it that could be old, and is left out. NaN while there is no such pair. A
    packet that a newer one overtook changes nothing. 8 bytes are kept for each pair of an arena; of more than 512
    robots only every n-th counts as a receiver, n = ceil(robots^2 / 2^18), so that these are 2 MB at most.

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
    needs = ()
    bounds = (0.0, None)

    def begin(self, static: Static) -> Measure:
        """A fresh measure, which keeps when the newest packet of each pair was sent."""
        newest = Newest(static)

        def measure(view: TickView) -> FloatArray | float:
            if view.truth.finished is None:
                return np.nan
            newest.see(view.truth.finished, view.alive)
            return newest.mean_age_s(view.truth.time_ns)

        return measure


@dataclass(frozen=True)
class PeakAgeOfInformation(OfWindow):
    """Mean over updates in the last `window_s` of t - u: t when a newer packet was received, u when the last was sent.

    The age of a pair falls with each update; its value just before is its peak. A first packet has no peak, and one
    that a newer one overtook is no update. Pairs are those of `age_of_information`. NaN without an update.

    Source: M. Costa, M. Codreanu, A. Ephremides, On the age of information in status update systems with packet
    management, IEEE Transactions on Information Theory 62(4), 2016.
    """

    name = "peak_age_of_information"
    help = "age of what a robot knew of another just before a newer packet came, mean over such updates in the window"
    unit = "s"
    needs = ()
    bounds = (0.0, None)

    def begin(self, static: Static) -> Measure:
        """A fresh measure, which keeps when the newest packet of each pair was sent, and the window's ticks."""
        place, sent_at_ns = _places(static)
        window = Window(static, self.window_s, 2)

        def measure(view: TickView) -> FloatArray | float:
            ended = view.truth.finished
            if ended is None:
                return np.nan
            peaks = np.zeros((2, static.arenas), np.int64)
            by_time = np.argsort(ended.final_at_ns, kind="stable")
            links = ended.fate, ended.arena, ended.receiver, ended.sender, ended.sent_at_ns, ended.final_at_ns
            _add_peaks(by_time, *links, place, sent_at_ns, peaks)
            total_ns, updates = window.add(peaks)
            return total_ns / np.where(updates > 0, updates * NS_PER_S, np.nan)

        return measure


@njit()
def _add_peaks(
    by_time: AnyArray,
    fate: AnyArray,
    arena: AnyArray,
    receiver: AnyArray,
    sender: AnyArray,
    sent_at_ns: AnyArray,
    final_at_ns: AnyArray,
    place: AnyArray,
    newest_ns: AnyArray,
    peaks: AnyArray,
):
    """Put in what was received; add the sum of peaks in ns and their number, (2, arenas)."""
    for i in by_time:
        if fate[i] != RECEIVED or place[receiver[i]] == NOT_COUNTED:
            continue
        a, s, r = arena[i], sender[i], place[receiver[i]]
        before_ns = newest_ns[a, s, r]
        if sent_at_ns[i] > before_ns:
            newest_ns[a, s, r] = sent_at_ns[i]
            if before_ns != NEVER:
                peaks[0, a] += final_at_ns[i] - before_ns
                peaks[1, a] += 1


def _places(static: Static) -> tuple[IntArray, IntArray]:
    """The place of each robot among receivers (robots,), and when the newest of each pair was sent: never yet.

    The latter is (arenas, robots, receivers), by sender first: rows of a packet stand together, and so do the places
    that they write to.
    """
    every = -(-static.robots * static.robots // MAX_PAIRS)  # robots from one receiver to the next
    index = np.arange(static.robots)
    place = np.where(index % every == 0, index // every, NOT_COUNTED)
    return place, np.full((static.arenas, static.robots, -(-static.robots // every)), NEVER, np.int64)


class Newest:
    """When the newest packet of each pair was sent, with its sum over pairs of robots alive, in ns."""

    def __init__(self, static: Static) -> None:
        arenas, robots = static.arenas, static.robots
        self._place, self._sent_at_ns = _places(static)
        self._alive: BoolArray = np.ones((arenas, robots), np.bool_)
        self._pairs: IntArray = np.zeros(arenas, np.int64)
        self._total_ns = [0] * arenas  # Python's whole numbers: a day of a million pairs is beyond 64 bits

    def see(self, ended: ReceptionRecords, alive: BoolArray) -> None:
        """Take in what was received; `alive` (arenas, robots) are the robots that count from now on."""
        gained_ns = np.zeros(len(self._pairs), np.int64)
        links = ended.fate, ended.arena, ended.receiver, ended.sender, ended.sent_at_ns
        _take(*links, self._place, alive, self._sent_at_ns, self._pairs, gained_ns)
        if not np.array_equal(alive, self._alive):
            self._alive = alive.copy()
            self._count_again()
            return
        self._total_ns = [total + gain for total, gain in zip(self._total_ns, gained_ns.tolist(), strict=True)]

    def mean_age_s(self, now_ns: int) -> FloatArray:
        """The mean over the pairs that count, (arenas,); NaN where there are none."""
        ages_s = [
            (now_ns * pairs - total) / (pairs * NS_PER_S) if pairs else np.nan
            for pairs, total in zip(self._pairs.tolist(), self._total_ns, strict=True)
        ]
        return np.array(ages_s, np.float64)

    def _count_again(self) -> None:
        counts = self._sent_at_ns != NEVER
        counts &= self._alive[:, :, None] & self._alive[:, None, self._place != NOT_COUNTED]
        self._pairs = np.count_nonzero(counts, axis=(1, 2))
        by_sender_ns = np.sum(self._sent_at_ns, axis=2, where=counts)
        self._total_ns = [sum(own) for own in by_sender_ns.tolist()]


@njit()
def _take(
    fate: AnyArray,
    arena: AnyArray,
    receiver: AnyArray,
    sender: AnyArray,
    sent_at_ns: AnyArray,
    place: AnyArray,
    alive: AnyArray,
    newest_ns: AnyArray,
    pairs: AnyArray,
    gained_ns: AnyArray,
):
    """Put in what was received; add to the pairs alive that ever received, (arenas,), and to the sum of their times."""
    for i in range(len(fate)):
        if fate[i] != RECEIVED or place[receiver[i]] == NOT_COUNTED:
            continue
        a, r, s = arena[i], receiver[i], sender[i]
        before_ns = newest_ns[a, s, place[r]]
        if sent_at_ns[i] <= before_ns:
            continue
        newest_ns[a, s, place[r]] = sent_at_ns[i]
        if alive[a, r] and alive[a, s]:
            pairs[a] += before_ns == NEVER
            gained_ns[a] += sent_at_ns[i] - (0 if before_ns == NEVER else before_ns)
