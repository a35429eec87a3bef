"""The figures of a live run in the terminal, over the latest tick, second and minute."""

import math
from collections import deque
from collections.abc import Callable

import numpy as np

from swarmwire.comms.base.arrays import IntArray
from swarmwire.comms.base.clock import Clock, tick_start_ns, to_ns, to_s
from swarmwire.comms.observe.truth import EventRecord, Static, Truth
from swarmwire.comms.robot.packets import FATE_NAMES, Fate
from swarmwire.metrics.measures.measure import Metrics
from swarmwire.metrics.text import abbreviate

SHOWN = ("order", "largest_component", "components")  # names of metrics
HISTORY_S = 60  # simulated; one value a second
MAX_EVENTS = 3  # latest events
MAX_NAMED = 4  # robot names in the text of an event
MARK_NS, MAX_MARKS = to_ns(0.1), 100  # wall time between two marks of progress, and number of marks


class Figures:
    """Figures of each tick; over several arenas levels are means, packets are sums.

    Attributes:
        done: number of finished ticks.
        running: number of arenas that have not stopped.
        fates: number of packets per intended receiver so far, by fate, (fates,).
        events: texts of the latest events in order of time.
    """

    def __init__(self, ticks: int, metrics: Metrics, clock: Clock, compiled_ns: Callable[[], int] = lambda: 0) -> None:
        """Create figures of a run of `ticks`; `metrics` must see a tick first, `compiled_ns` is the compile time."""
        self.ticks, self._metrics, self._clock, self._compiled_ns = ticks, metrics, clock, compiled_ns

    def begin(self, static: Static) -> None:
        """Start the figures of a run."""
        self.static, self.done, self.running = static, 0, static.arenas
        measured = [metric.name for metric in self._metrics.metrics]
        self.levels = tuple(name for name in SHOWN if name in measured)
        self.fates: IntArray = np.zeros(len(FATE_NAMES), np.int64)
        self.events: deque[str] = deque(maxlen=MAX_EVENTS)
        self._in_range = 0
        self._second: deque[tuple[int, int]] = deque(maxlen=static.rate_hz)  # per tick: received, in range
        self._history: deque[list[float]] = deque(maxlen=HISTORY_S)
        self._seconds = 0  # simulated seconds so far
        self._compiled_before_ns = self._begun_compiled_ns = self._compiled_ns()
        self.forget_speed()

    def see(self, truth: Truth) -> None:
        """Add a tick."""
        self.done = truth.tick + 1
        self.running = int(np.count_nonzero(truth.running))
        if truth.tally is not None:
            fates, in_range = truth.tally.fates, truth.tally.in_range
            # A sum takes ten times as long as an index, in every tick.
            total, reached = (fates[0], in_range[0]) if len(fates) == 1 else (fates.sum(axis=0), in_range.sum())
            self.fates += total
            self._in_range += int(reached)
            self._second.append((int(total[Fate.RECEIVED]), int(reached)))
        if truth.tick % self.static.rate_hz == 0:
            self._history.append([self.level(name) for name in self.levels])
            self._seconds += 1
        self.events.extend(_words(event, truth.time_ns, self.static) for event in truth.events)
        if self.compiling:
            self._compiled_before_ns = self._compiled_ns()
            self.forget_speed()
        now_ns = self._clock.now_ns()
        if now_ns - self._marks[-1][0] >= MARK_NS:
            self._marks.append((now_ns, self.done))

    @property
    def compiling(self) -> bool:
        """True if kernels were compiled since the latest tick."""
        return self._compiled_ns() > self._compiled_before_ns

    @property
    def compiled_s(self) -> float:
        """Wall time spent on compiling since the run began."""
        return to_s(self._compiled_ns() - self._begun_compiled_ns)

    @property
    def stopped(self) -> str:
        """Text about stopped arenas; empty while all run."""
        arenas = self.static.arenas
        return f", {self.running} of {arenas} arenas running" if self.running < arenas else ""

    @property
    def time_s(self) -> float:
        """Simulated time so far."""
        return to_s(tick_start_ns(self.done, self.static.rate_hz))

    @property
    def duration_s(self) -> float:
        """Simulated time of the whole run."""
        return to_s(tick_start_ns(self.ticks, self.static.rate_hz))

    @property
    def link_pdr(self) -> float:
        """Received packets over packets in range so far; NaN if none was in range."""
        return _share(int(self.fates[Fate.RECEIVED]), self._in_range)

    @property
    def link_pdr_1s(self) -> float:
        """Link PDR over the latest simulated second."""
        return _share(sum(received for received, _ in self._second), sum(in_range for _, in_range in self._second))

    def level(self, name: str) -> float:
        """Return a metric of the latest tick; NaN without a value."""
        return _mean(self._metrics.latest[name].tolist())

    def history(self, name: str, per_value_s: int) -> list[float]:
        """Return a metric over the latest minute, as means of fixed periods of `per_value_s`."""
        column = self.levels.index(name)
        first = self._seconds - len(self._history)
        parts: dict[int, list[float]] = {}
        for second, values in enumerate(self._history, first):
            parts.setdefault(second // per_value_s, []).append(values[column])
        return [_mean(values) for values in parts.values()]

    def speed(self, over_s: float) -> float:
        """Return simulated s per s of wall time over the latest `over_s` of wall time; NaN at the start of the run."""
        now_ns = self._clock.now_ns()
        older = [mark for mark in self._marks if now_ns - mark[0] >= to_ns(over_s)]
        mark_ns, done = older[-1] if older else self._marks[0]
        simulated_s = (self.done - done) / self.static.rate_hz
        return simulated_s / to_s(now_ns - mark_ns) if now_ns - mark_ns >= MARK_NS else math.nan

    def forget_speed(self) -> None:
        """Restart the measurement of the speed."""
        self._marks: deque[tuple[int, int]] = deque([(self._clock.now_ns(), self.done)], maxlen=MAX_MARKS)


def _words(event: EventRecord, time_ns: int, static: Static) -> str:
    robots = [name for arena_names in event.changed_names(static) for name in arena_names]
    subject = f"{len(robots)} robots" if static.arenas > 1 else abbreviate(robots, MAX_NAMED) or "no robot"
    return f"{to_s(time_ns):.1f} s  {event.words}: {subject}"


def _mean(values: list[float]) -> float:
    defined = [value for value in values if not math.isnan(value)]
    return sum(defined) / len(defined) if defined else math.nan


def _share(part: int, total: int) -> float:
    return part / total if total else math.nan
