"""Fragmentation: when the radio graph of a swarm falls apart, and when it is whole again.

    whole     components > 1      -> split    (since this tick)
    split     components = 1      -> whole
    split     for hold_s          -> event    (counted once, in this tick)
    event     components = 1      -> whole    (re-joined: its length is known)

A swarm that starts in pieces has not fallen apart: it is no event until it was whole once. While no robot is alive
nothing changes, and without a radio there are no events at all.
"""

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.comms.base.clock import NS_PER_S, to_ns
from swarmwire.comms.base.config import parameter
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.observe.truth import Static
from swarmwire.metrics.measures.metric import Measure, Metric, TickView

NEVER = -1


@dataclass(frozen=True)
class OfFragmentation(Metric):
    """A metric of fragmentation events."""

    needs = ("graph",)

    hold_s: float = parameter(1.0, help="a shorter split is no event", unit="s", at_least=0.0)

    @abstractmethod
    def value(self, events: "Fragmentation", counted: IntArray) -> FloatArray:
        """The metric (arenas,) by the events so far, and those that are `counted` in this tick, (arenas,)."""

    def begin(self, static: Static) -> Measure:
        """A fresh measure, which is NaN without a radio."""
        events = Fragmentation(static, self.hold_s)

        def measure(view: TickView) -> FloatArray | float:
            counted = events.see(view)
            return np.nan if counted is None else self.value(events, counted)

        return measure


class Fragmentation:
    """The events of each arena so far. `see` must be called once per tick.

    Attributes:
        started: (arenas,) events counted so far.
        rejoined: (arenas,) of these, that are over.
        rejoined_s: by arena, how long each event lasted that is over, in order.
        rejoined_now: the arenas of which an event was over in the last tick.
        statistic_s: (arenas,) what a metric last made of `rejoined_s`; NaN before.
    """

    def __init__(self, static: Static, hold_s: float) -> None:
        arenas = static.arenas
        self._hold_ns = to_ns(hold_s)
        self.started: IntArray = np.zeros(arenas, np.int64)
        self.rejoined: IntArray = np.zeros(arenas, np.int64)
        self.rejoined_s: list[list[float]] = [[] for _ in range(arenas)]
        self.rejoined_now: list[int] = []
        self.statistic_s: FloatArray = np.full(arenas, np.nan)
        self._was_whole: BoolArray = np.zeros(arenas, np.bool_)
        self._since_ns: IntArray = np.full(arenas, NEVER, np.int64)  # start of the present split
        self._event: BoolArray = np.zeros(arenas, np.bool_)  # it was counted
        self._counted: IntArray = np.zeros(arenas, np.int64)  # in the last tick
        self._lasted_ns: IntArray = np.full(arenas, NEVER, np.int64)  # those that were over in it

    def see(self, view: TickView) -> IntArray | None:
        """How many events, 0 or 1, are counted in this tick, (arenas,); None without a radio."""
        self.rejoined_now, found = [], view.components
        if found is None:
            return None
        state = self._was_whole, self._since_ns, self._event, self.started, self._counted, self._lasted_ns
        if _follow(found.pieces, view.truth.time_ns, self._hold_ns, *state):
            self.rejoined_now = np.flatnonzero(self._lasted_ns != NEVER).tolist()
            self.rejoined[self.rejoined_now] += 1
            for arena in self.rejoined_now:
                self.rejoined_s[arena].append(int(self._lasted_ns[arena]) / NS_PER_S)
        return self._counted


@njit()
def _follow(
    pieces: AnyArray,
    now_ns: int,
    hold_ns: int,
    was_whole: AnyArray,
    since_ns: AnyArray,
    event: AnyArray,
    started: AnyArray,
    counted: AnyArray,
    lasted_ns: AnyArray,
):
    """The table above for each arena: sets `counted`, and `lasted_ns` where an event is over; whether any is."""
    any_over = False
    for arena in range(len(pieces)):
        counted[arena], lasted_ns[arena] = 0, NEVER
        if pieces[arena] == 1:
            if event[arena]:
                lasted_ns[arena] = now_ns - since_ns[arena]
                any_over = True
            was_whole[arena], since_ns[arena], event[arena] = True, NEVER, False
        elif pieces[arena] > 1 and was_whole[arena]:
            if since_ns[arena] == NEVER:
                since_ns[arena] = now_ns
            if not event[arena] and now_ns - since_ns[arena] >= hold_ns:
                event[arena], counted[arena] = True, 1
                started[arena] += 1
    return any_over


@dataclass(frozen=True)
class Fragmentations(OfFragmentation):
    """Times that the radio graph's components rose above 1 and stayed there for at least `hold_s`.

    Counted at the end of that hold, and only after the graph had one component for a tick: of a swarm that is in pieces
    from its start the number is 0. NaN without a radio.
    """

    name = "fragmentations"
    help = "times that the radio graph, once it was whole, fell apart for at least hold_s"
    kind = "count"
    standard = True
    bounds = (0.0, None)

    def value(self, events: Fragmentation, counted: IntArray) -> FloatArray:
        """Those of this tick."""
        return counted.astype(np.float64)


@dataclass(frozen=True)
class Fragmented(OfFragmentation):
    """1 while a fragmentation event lasts, 0 else: its mean is the share of the time.

    It is 1 from the tick in which the event is counted, as
    it is not known before that the split will last: the share of the time from falling apart to being whole again is
    this mean + `fragmentations` x `hold_s` / the run's length. NaN without a radio.
    """

    name = "fragmented"
    help = "1 while the radio graph, once it was whole, has fallen apart for at least hold_s, 0 else"
    bounds = (0.0, 1.0)

    def value(self, events: Fragmentation, counted: IntArray) -> FloatArray:
        """Whether one is open."""
        return (events.started - events.rejoined).astype(np.float64)


@dataclass(frozen=True)
class Unrejoined(OfFragmentation):
    """Fragmentation events that have not re-joined / events so far: its `final` is the share censored by the end.

    An arena has at most one that is open. NaN before the first event.
    """

    name = "unrejoined"
    help = "share of the fragmentations so far that have not re-joined"
    standard = True
    bounds = (0.0, 1.0)

    def value(self, events: Fragmentation, counted: IntArray) -> FloatArray:
        """Those that are open over all."""
        return (events.started - events.rejoined) / np.where(events.started > 0, events.started, np.nan)


class _Rejoin(OfFragmentation):
    """A statistic of the times in s from falling apart to one component, over the events re-joined so far.

    Each is at least `hold_s`; `final` is that of the run. Events that have not re-joined are left out, so a
    run that ends early looks quicker: read it with `unrejoined`. NaN until the first has re-joined.
    """

    unit = "s"
    bounds = (0.0, None)

    @abstractmethod
    def statistic(self, lengths_s: list[float]) -> float:
        """The statistic of the lengths of the events that are over: at least one."""

    def value(self, events: Fragmentation, counted: IntArray) -> FloatArray:
        """Worked out anew where an event was over in this tick."""
        for arena in events.rejoined_now:
            events.statistic_s[arena] = self.statistic(events.rejoined_s[arena])
        return events.statistic_s


@dataclass(frozen=True)
class RejoinMedian(_Rejoin):
    """Median time to re-join."""

    name = "rejoin_median"
    help = "median time to re-join over the fragmentations re-joined so far, in s"
    standard = True

    def statistic(self, lengths_s: list[float]) -> float:
        """The middle one, or the mean of the two in the middle."""
        return float(np.median(lengths_s))


@dataclass(frozen=True)
class RejoinWorst(_Rejoin):
    """Longest time to re-join."""

    name = "rejoin_worst"
    help = "longest time to re-join over the fragmentations re-joined so far, in s"
    standard = True

    def statistic(self, lengths_s: list[float]) -> float:
        """The longest."""
        return max(lengths_s)
