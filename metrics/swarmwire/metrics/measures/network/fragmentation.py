"""Fragmentation events: splits of a swarm's radio graph, from connected to several components and back.

    connected   components > 1   -> split       (since this tick)
    split       components = 1   -> connected
    split       for hold_s       -> event       (counted once, in this tick)
    event       components = 1   -> connected   (re-joined: its length is final)

A swarm that starts in several components has no event before it was connected once. While no robot is alive nothing
changes, and without a radio there are no events.
"""

from abc import abstractmethod
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.comms.base.clock import NS_PER_S, to_ns
from swarmwire.comms.base.config import parameter
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.observe.truth import Static
from swarmwire.metrics.measures.metric import Measure, Metric, TickView

NEVER = -1


@dataclass(frozen=True)
class FragmentationMetric(Metric):
    """A metric of fragmentation events."""

    needs = ("graph",)

    hold_s: float = parameter(1.0, help="a shorter split is no event", unit="s", at_least=0.0)

    @abstractmethod
    def value(self, events: "Fragmentation", latest: FloatArray) -> FloatArray:
        """Return the metric (arenas,) from the events so far; `latest` (arenas,) may keep values, NaN at first."""

    def begin(self, static: Static) -> Measure:
        """Return a measure that is NaN without a radio."""
        # The first metric of a tick counts the events for all metrics of the same hold time.
        own_events, latest = Fragmentation(static, self.hold_s), np.full(static.arenas, np.nan)

        def measure(view: TickView) -> FloatArray | float:
            if view.components is None:
                return np.nan
            events = view.once((Fragmentation, self.hold_s), lambda: own_events.see(view))
            return self.value(events, latest)

        return measure


class _Splits(NamedTuple):
    """State of the table above, (arenas,) each."""

    was_connected: BoolArray
    since_ns: IntArray  # start of the present split; NEVER without one
    is_event: BoolArray  # True if the present split was counted
    started: IntArray  # events so far
    counted: IntArray  # events that were counted in the last tick, 0 or 1
    length_ns: IntArray  # length of the event that ended in the last tick; NEVER without one


class Fragmentation:
    """The events of each arena so far. `see` must be called once per tick.

    Attributes:
        started: (arenas,) events counted so far.
        rejoined: (arenas,) events that have ended.
        rejoined_s: length of each event that has ended, in order, one list per arena.
        rejoined_now: arenas in which an event ended in the last tick.
        counted: (arenas,) events that were counted in the last tick, 0 or 1.
    """

    def __init__(self, static: Static, hold_s: float) -> None:
        arenas = static.arenas
        self._hold_ns = to_ns(hold_s)
        self._splits = _Splits(
            was_connected=np.zeros(arenas, np.bool_),
            since_ns=np.full(arenas, NEVER, np.int64),
            is_event=np.zeros(arenas, np.bool_),
            started=np.zeros(arenas, np.int64),
            counted=np.zeros(arenas, np.int64),
            length_ns=np.full(arenas, NEVER, np.int64),
        )
        self.started, self.counted = self._splits.started, self._splits.counted
        self.rejoined: IntArray = np.zeros(arenas, np.int64)
        self.rejoined_s: list[list[float]] = [[] for _ in range(arenas)]
        self.rejoined_now: list[int] = []

    def see(self, view: TickView) -> "Fragmentation":
        """Count the events of a tick with a radio graph; return this object."""
        assert view.components is not None
        self.rejoined_now, length_ns = [], self._splits.length_ns
        if _update(view.components.number, view.truth.time_ns, self._hold_ns, self._splits):
            self.rejoined_now = np.flatnonzero(length_ns != NEVER).tolist()
            self.rejoined[self.rejoined_now] += 1
            for arena in self.rejoined_now:
                self.rejoined_s[arena].append(int(length_ns[arena]) / NS_PER_S)
        return self


@njit()
def _update(components: AnyArray, now_ns: int, hold_ns: int, splits: Any):
    """Apply the table above to each arena; return True if an event ended."""
    was_connected, since_ns, is_event, started, counted, length_ns = splits
    any_ended = False
    for arena in range(len(components)):
        counted[arena], length_ns[arena] = 0, NEVER
        if components[arena] == 1:
            if is_event[arena]:
                length_ns[arena] = now_ns - since_ns[arena]
                any_ended = True
            was_connected[arena], since_ns[arena], is_event[arena] = True, NEVER, False
        elif components[arena] > 1 and was_connected[arena]:
            if since_ns[arena] == NEVER:
                since_ns[arena] = now_ns
            if not is_event[arena] and now_ns - since_ns[arena] >= hold_ns:
                is_event[arena], counted[arena] = True, 1
                started[arena] += 1
    return any_ended


@dataclass(frozen=True)
class Fragmentations(FragmentationMetric):
    """Times that the radio graph's components rose above 1 and stayed there for at least `hold_s`.

    Counted at the end of that hold time, and only after the graph had one component for a tick: a swarm that stays in
    several components from the start has 0. NaN without a radio.
    """

    name = "fragmentations"
    help = "times that the radio graph, once it was whole, fell apart for at least hold_s"
    kind = "count"
    standard = True
    bounds = (0.0, None)

    def value(self, events: Fragmentation, latest: FloatArray) -> FloatArray:
        """Return the events counted in this tick."""
        return events.counted.astype(np.float64)


@dataclass(frozen=True)
class Fragmented(FragmentationMetric):
    """1 while a fragmentation event lasts, 0 else: its mean is the share of the time.

    It is 1 from the tick in which the event is counted, `hold_s` after the split: the share of the time from the split
    to the re-join is this mean + `fragmentations` x `hold_s` / the run's length. NaN without a radio.
    """

    name = "fragmented"
    help = "1 while the radio graph, once it was whole, has fallen apart for at least hold_s, 0 else"
    bounds = (0.0, 1.0)

    def value(self, events: Fragmentation, latest: FloatArray) -> FloatArray:
        """Return 1 for arenas with an open event."""
        return (events.started - events.rejoined).astype(np.float64)


@dataclass(frozen=True)
class Unrejoined(FragmentationMetric):
    """Fragmentation events that have not re-joined / events so far: its `final` is the share censored by the end.

    An arena has at most one that is open. NaN before the first event.
    """

    name = "unrejoined"
    help = "share of the fragmentations so far that have not re-joined"
    standard = True
    bounds = (0.0, 1.0)

    def value(self, events: Fragmentation, latest: FloatArray) -> FloatArray:
        """Return the open events / all events."""
        return (events.started - events.rejoined) / np.where(events.started > 0, events.started, np.nan)


class _Rejoin(FragmentationMetric):
    """A statistic of the times in s from the split to one component, over the events re-joined so far.

    Each time is at least `hold_s`; `final` is the statistic of the run. Events that have not re-joined are left out, so
    a run that ends early looks quicker: read it with `unrejoined`. NaN until the first has re-joined.
    """

    unit = "s"
    bounds = (0.0, None)

    @abstractmethod
    def statistic(self, lengths_s: list[float]) -> float:
        """Return the statistic of the lengths, one or more, of the events that have ended."""

    def value(self, events: Fragmentation, latest: FloatArray) -> FloatArray:
        """Return the statistic; it changes only in arenas in which an event ended in this tick."""
        for arena in events.rejoined_now:
            latest[arena] = self.statistic(events.rejoined_s[arena])
        return latest


@dataclass(frozen=True)
class RejoinMedian(_Rejoin):
    """Median time to re-join."""

    name = "rejoin_median"
    help = "median time to re-join over the fragmentations re-joined so far, in s"
    standard = True

    def statistic(self, lengths_s: list[float]) -> float:
        """Return the median."""
        return float(np.median(lengths_s))


@dataclass(frozen=True)
class RejoinWorst(_Rejoin):
    """Longest time to re-join."""

    name = "rejoin_worst"
    help = "longest time to re-join over the fragmentations re-joined so far, in s"
    standard = True

    def statistic(self, lengths_s: list[float]) -> float:
        """Return the longest."""
        return max(lengths_s)
