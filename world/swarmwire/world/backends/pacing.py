"""The pace of a run in real time: the wall-clock deadline of each tick, and statistics of latencies.

`LatencyHistogram` counts any number of latencies in bounded memory. `Pace` delays the loop until a tick ends by the
wall clock, and measures the loop's lag.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from swarmwire.comms.base.arrays import IntArray
from swarmwire.comms.base.clock import Clock, tick_start_ns, to_ns, to_s

NS_PER_US = 1000
BINS_PER_E_FOLD = 200  # bins per factor of e above 1 us: 0.5 % apart
BINS = 5200  # the last bin is days
WARNING_INTERVAL_S = 5.0  # wall time between two warnings about the lag
STALL_S = 5.0  # a longer lag from a single tick means that the process was frozen


@dataclass(frozen=True)
class LatencySummary:
    """Latencies in wall time; percentiles within 0.5 %."""

    count: int
    p50_s: float
    p99_s: float
    worst_s: float


class LatencyHistogram:
    """Counts latencies in bins 0.5 % apart; below 1 us a bin is 5 ns wide."""

    def __init__(self) -> None:
        self._bins = np.zeros(BINS, np.int64)
        self._worst_ns = 0

    def add(self, late_ns: IntArray) -> None:
        """Count latencies, (k,); negative ones count as 0."""
        if not len(late_ns):
            return
        late_ns = np.maximum(late_ns, 0)
        self._worst_ns = max(self._worst_ns, int(late_ns.max()))
        bin_index = (np.log1p(late_ns / NS_PER_US) * BINS_PER_E_FOLD).astype(np.int64)
        self._bins += np.bincount(np.minimum(bin_index, BINS - 1), minlength=BINS)

    def summary(self) -> LatencySummary | None:
        """Return the summary of all latencies; None without latencies."""
        count = int(self._bins.sum())
        if not count:
            return None
        return LatencySummary(count, self._percentile_s(0.5), self._percentile_s(0.99), to_s(self._worst_ns))

    def _percentile_s(self, share: float) -> float:
        """Return the latency that this share does not exceed: the upper end of its bin, at most the worst latency."""
        cumulative: IntArray = np.cumsum(self._bins)
        bin_index = int(np.searchsorted(cumulative, share * int(cumulative[-1])))
        upper_ns = float(np.expm1((bin_index + 1) / BINS_PER_E_FOLD)) * NS_PER_US
        return to_s(min(round(upper_ns), self._worst_ns))


class Pace:
    """Paces ticks by the wall clock: a tick ends at its simulated end / factor after the first `begin`.

    A loop that lags does not wait until it has caught up. A loop that was frozen, by a debugger, Ctrl-Z or with its
    machine, continues as after a pause, since no agent could act in the thousands of ticks that are due.

    Attributes:
        clock: the wall clock.
        rate_hz: ticks per simulated second.
        factor: present simulated seconds per second of wall time.
        missed_ticks: ticks that ended before the loop waited for their end, so the next one started late.
        worst_lag_ns: the greatest lag, wall time.
        lag_ns: the lag at the end of the last tick, wall time; 0 if the loop waited for that end.
        jitter: the latency of the start of ticks after the end of the tick before.
        delivery: the latency of the delivery of packets after their reception by the modelled radio.
    """

    def __init__(self, clock: Clock, rate_hz: int, factor: float, warn: Callable[[str], None]) -> None:
        """`factor` is in simulated seconds per second of wall time; `warn` is called as soon as the loop lags."""
        self.factor, self.clock, self.rate_hz, self._warn_user = factor, clock, rate_hz, warn
        self._first_tick = self._paused_ns = 0
        self._first_ns: int | None = None  # wall time at which the schedule's first tick began
        self._next_warning_ns: int | None = None
        self._next_ns: int | None = None  # planned start of the next tick; None before the schedule's second
        self.missed_ticks = self.worst_lag_ns = self.lag_ns = 0
        self.jitter, self.delivery = LatencyHistogram(), LatencyHistogram()

    def begin(self) -> int:
        """Begin a tick, and return the wall time in ns, without pauses; the first call sets the schedule."""
        now_ns = self.clock.now_ns()
        if self._first_ns is None:
            self._first_ns = now_ns
        if self._next_ns is not None:
            self.jitter.add(np.array([now_ns - self._next_ns]))
        return now_ns - self._paused_ns

    def now_ns(self) -> int:
        """Return the wall time."""
        return self.clock.now_ns()

    def count_delivered(self, received_at_ns: IntArray) -> None:
        """Count the delivery latency of packets that the modelled radio received at these simulated times, (k,)."""
        if len(received_at_ns) and self._first_ns is not None:
            self.delivery.add(np.array(self.latencies_ns(received_at_ns.tolist())))

    def latencies_ns(self, at_ns: list[int]) -> list[int]:
        """Return the wall time that has passed since each of these simulated times; 0 before the first tick."""
        if self._first_ns is None:
            return [0] * len(at_ns)
        elapsed_ns, first_tick_ns, factor = self.clock.now_ns() - self._first_ns, self._first_tick_ns, self.factor
        return [elapsed_ns - int((ns - first_tick_ns) / factor) for ns in at_ns]

    def simulated_ns(self, wall_ns: int) -> int:
        """Return the simulated time at a wall time, by the present schedule; its start before the first tick."""
        if self._first_ns is None:
            return self._first_tick_ns
        return self._first_tick_ns + round((wall_ns - self._first_ns) * self.factor)

    def wall_ns(self, simulated_ns: int) -> int:
        """Return the wall time of a simulated time, by the present schedule; only after its first `begin`."""
        assert self._first_ns is not None
        return self._first_ns + round((simulated_ns - self._first_tick_ns) / self.factor)

    def end_ns(self, tick: int) -> int:
        """Return the wall time at which a tick ends."""
        first_ns = self.begin() + self._paused_ns if self._first_ns is None else self._first_ns
        return first_ns + round(self._span_ns(tick) / self.factor)

    def restart(self, tick: int, factor: float, paused_ns: int = 0) -> None:
        """Start a new schedule with this tick now, after a pause of `paused_ns`."""
        self.factor, self._first_tick, self._first_ns = factor, tick, self.clock.now_ns()
        self._next_ns = None
        self._paused_ns += paused_ns

    def wait(self, tick: int) -> None:
        """Wait until the tick ends by the wall clock."""
        self._next_ns = end_ns = self.end_ns(tick)
        lag_ns, last_lag_ns = self.clock.now_ns() - end_ns, self.lag_ns
        self.lag_ns = max(0, lag_ns)
        if lag_ns <= 0:
            self.clock.sleep_until(end_ns)
            late_ns = self.clock.now_ns() - end_ns
            if late_ns > to_ns(STALL_S):  # frozen during the sleep
                self._restart_after_stall(tick, late_ns)
            return
        self.missed_ticks += 1
        self.worst_lag_ns = max(self.worst_lag_ns, lag_ns)
        if lag_ns - last_lag_ns > to_ns(STALL_S):
            self._restart_after_stall(tick, lag_ns)
            return
        self._warn(
            f"this machine does not keep up with {self.factor:g} x real time: "
            f"at tick {tick} the loop is {1000 * to_s(lag_ns):,.1f} ms behind"
        )

    def _restart_after_stall(self, tick: int, stalled_ns: int) -> None:
        """Restart the schedule with the next tick: the stalled time counts as a pause."""
        self.restart(tick + 1, self.factor, stalled_ns)
        self.lag_ns = 0
        self._warn(f"the loop stalled for {to_s(stalled_ns):.1f} s in tick {tick}; the schedule restarts from there")

    def _warn(self, text: str) -> None:
        now_ns = self.clock.now_ns()
        if self._next_warning_ns is None or now_ns >= self._next_warning_ns:
            self._next_warning_ns = now_ns + to_ns(WARNING_INTERVAL_S)
            self._warn_user(f"real time: {text}")

    def _span_ns(self, tick: int) -> int:
        """Return the simulated time from the start of the schedule to the end of a tick."""
        return tick_start_ns(tick + 1, self.rate_hz) - self._first_tick_ns

    @property
    def _first_tick_ns(self) -> int:
        return tick_start_ns(self._first_tick, self.rate_hz)
