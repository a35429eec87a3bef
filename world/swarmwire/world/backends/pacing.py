"""How late things came that were due at a time: percentiles of any number of them, in bounded memory."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import IntArray
from swarmwire.comms.clock import Clock, tick_start_ns, to_ns, to_s

NS_PER_US = 1000
PER_FOLD = 200  # classes in which 1 us and more are counted, for each factor of e: 0.5 % apart
CLASSES = 5200  # up to days


@dataclass(frozen=True)
class LatencyHistogram:
    """By how much things came later than they were due, wall time; percentiles within 0.5 %."""

    count: int
    p50_s: float
    p99_s: float
    worst_s: float


class TimingReport:
    """Counts delays in classes 0.5 % apart, of 5 ns below 1 us."""

    def __init__(self) -> None:
        self._counted = np.zeros(CLASSES, np.int64)
        self._worst_ns = 0

    def add(self, late_ns: IntArray) -> None:
        """Count these, (k,); what came early was on time."""
        if not len(late_ns):
            return
        late_ns = np.maximum(late_ns, 0)
        self._worst_ns = max(self._worst_ns, int(late_ns.max()))
        place = (np.log1p(late_ns / NS_PER_US) * PER_FOLD).astype(np.int64)
        self._counted += np.bincount(np.minimum(place, CLASSES - 1), minlength=CLASSES)

    def delays(self) -> LatencyHistogram | None:
        """What was counted; None: nothing."""
        count = int(self._counted.sum())
        if not count:
            return None
        return LatencyHistogram(count, self._percentile_s(0.5), self._percentile_s(0.99), to_s(self._worst_ns))

    def _percentile_s(self, share: float) -> float:
        """So that this share is no later: the upper end of its class, but never above the worst."""
        below: IntArray = np.cumsum(self._counted)
        place = int(np.searchsorted(below, share * int(below[-1])))
        upper_ns = float(np.expm1((place + 1) / PER_FOLD)) * NS_PER_US
        return to_s(min(round(upper_ns), self._worst_ns))


# --- The pace of a run in real time: when each tick is over by the wall clock, and how far the loop lags behind.


REPEAT_S = 5.0  # wall time: not to be told more often that the machine does not keep up
STANDS_STILL_S = 5.0  # wall time that is lost within a tick: no machine is so slow, it was frozen


class Pace:
    """Tick k is over its end / factor after the first `begin`. A loop that lags does not wait until it is level again.

    One that was frozen, by a debugger, Ctrl-Z or with its machine, goes on from there as after a pause: thousands of
    ticks at once would be none that an agent could act in.

    Attributes:
        factor: simulated seconds per second of wall time, at present.
        missed_ticks: ticks that were over before the loop came to wait for it, so the next one started late.
        worst_lag_ns: by how much at most, wall time.
        lag_ns: how far behind the last tick was when it was over, wall time; 0: it was waited for.
        jitter: by how much ticks began after the end of those before.
        delivery: by how much packets were handed over after the modelled radio had them.
    """

    def __init__(self, clock: Clock, rate_hz: int, factor: float, say: Callable[[str], None]) -> None:
        """`factor` simulated seconds per second of wall time; `say` is told at once when the loop falls behind."""
        self.factor, self._clock, self._rate_hz, self._say = factor, clock, rate_hz, say
        self._first_tick = self._paused_ns = 0
        self._first_ns: int | None = None  # when the first tick of this schedule began, wall time
        self._quiet_until_ns: int | None = None
        self._next_ns: int | None = None  # when the next tick is to begin, where there was one before
        self.missed_ticks = self.worst_lag_ns = self.lag_ns = 0
        self.jitter, self.delivery = TimingReport(), TimingReport()

    def begin(self) -> int:
        """A tick begins; the first sets the schedule. Returns the wall time in ns, pauses left out."""
        now_ns = self._clock.now_ns()
        if self._first_ns is None:
            self._first_ns = now_ns
        if self._next_ns is not None:
            self.jitter.add(np.array([now_ns - self._next_ns]))
        return now_ns - self._paused_ns

    def now_ns(self) -> int:
        """Wall time."""
        return self._clock.now_ns()

    def handed_over(self, received_at_ns: IntArray) -> None:
        """Packets were handed over just now that the modelled radio had at these simulated times, (k,)."""
        if len(received_at_ns) and self._first_ns is not None:
            after_ns = (received_at_ns - self._first_tick_ns) / self.factor
            self.delivery.add(self._clock.now_ns() - self._first_ns - after_ns.astype(np.int64))

    def simulated_ns(self, wall_ns: int) -> int:
        """Simulated time at a time of the wall clock, by the present schedule; before there is one, its start."""
        if self._first_ns is None:
            return self._first_tick_ns
        return self._first_tick_ns + round((wall_ns - self._first_ns) * self.factor)

    def over_ns(self, tick: int) -> int:
        """When a tick is over, wall time."""
        first_ns = self.begin() + self._paused_ns if self._first_ns is None else self._first_ns
        return first_ns + round(self._span_ns(tick) / self.factor)

    def begin_anew(self, tick: int, factor: float, paused_ns: int = 0) -> None:
        """A new schedule, in which this tick begins now, after a pause of so long; what lagged before is forgotten."""
        self.factor, self._first_tick, self._first_ns = factor, tick, self._clock.now_ns()
        self._next_ns = None
        self._paused_ns += paused_ns

    def hold(self, tick: int) -> None:
        """Return once the tick is over by the wall clock."""
        self._next_ns = over_ns = self.over_ns(tick)
        lag_ns, before_ns = self._clock.now_ns() - over_ns, self.lag_ns
        self.lag_ns = max(0, lag_ns)
        if lag_ns <= 0:
            self._clock.sleep_until(over_ns)
            late_ns = self._clock.now_ns() - over_ns
            if late_ns > to_ns(STANDS_STILL_S):  # frozen as it slept
                self._stood_still(tick, late_ns)
            return
        self.missed_ticks += 1
        self.worst_lag_ns = max(self.worst_lag_ns, lag_ns)
        if lag_ns - before_ns > to_ns(STANDS_STILL_S):
            self._stood_still(tick, lag_ns)
            return
        self._tell(
            f"this machine does not keep up with {self.factor:g} x real time: "
            f"at tick {tick} the loop is {1000 * to_s(lag_ns):,.1f} ms behind"
        )

    def _stood_still(self, tick: int, for_ns: int) -> None:
        """Go on from here: the time in which nothing could be done counts as a pause."""
        self.begin_anew(tick + 1, self.factor, for_ns)
        self.lag_ns = 0
        self._tell(f"the loop stood still for {to_s(for_ns):.1f} s in tick {tick}, and goes on from there")

    def _tell(self, text: str) -> None:
        now_ns = self._clock.now_ns()
        if self._quiet_until_ns is None or now_ns >= self._quiet_until_ns:
            self._quiet_until_ns = now_ns + to_ns(REPEAT_S)
            self._say(f"real time: {text}")

    def _span_ns(self, tick: int) -> int:
        """Simulated time from the start of the schedule to the end of a tick."""
        return tick_start_ns(tick + 1, self._rate_hz) - self._first_tick_ns

    @property
    def _first_tick_ns(self) -> int:
        return tick_start_ns(self._first_tick, self._rate_hz)
