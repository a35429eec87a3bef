"""The pace of a run in real time: when each tick is over by the wall clock, and how far the loop lags behind."""

from collections.abc import Callable

from swarmwire.comms.clock import Clock, tick_start_ns, to_ns, to_s

REPEAT_S = 5.0  # wall time: not to be told more often that the machine does not keep up


class Pace:
    """Tick k is over its end / factor after the first `begin`. A loop that lags does not wait until it is level again.

    Attributes:
        factor: simulated seconds per second of wall time, at present.
        missed_ticks: ticks that were over before the loop came to wait for it, so the next one started late.
        worst_lag_ns: by how much at most, wall time.
        lag_ns: how far behind the last tick was when it was over, wall time; 0: it was waited for.
    """

    def __init__(self, clock: Clock, rate_hz: int, factor: float, say: Callable[[str], None]) -> None:
        """`factor` simulated seconds per second of wall time; `say` is told at once when the loop falls behind."""
        self.factor, self._clock, self._rate_hz, self._say = factor, clock, rate_hz, say
        self._first_tick = self._paused_ns = 0
        self._first_ns: int | None = None  # when the first tick of this schedule began, wall time
        self._quiet_until_ns: int | None = None
        self.missed_ticks = self.worst_lag_ns = self.lag_ns = 0

    def begin(self) -> int:
        """A tick begins; the first sets the schedule. Returns the wall time in ns, pauses left out."""
        now_ns = self._clock.now_ns()
        if self._first_ns is None:
            self._first_ns = now_ns
        return now_ns - self._paused_ns

    def begin_anew(self, tick: int, factor: float, paused_ns: int = 0) -> None:
        """A new schedule, in which this tick begins now, after a pause of so long; what lagged before is forgotten."""
        self.factor, self._first_tick, self._first_ns = factor, tick, self._clock.now_ns()
        self._paused_ns += paused_ns

    def hold(self, tick: int) -> None:
        """Return once the tick is over by the wall clock."""
        first_ns = self.begin() if self._first_ns is None else self._first_ns
        over_ns = first_ns + round(self._span_ns(tick) / self.factor)
        lag_ns = self._clock.now_ns() - over_ns
        self.lag_ns = max(0, lag_ns)
        if lag_ns <= 0:
            self._clock.sleep_until(over_ns)
            return
        self.missed_ticks += 1
        self.worst_lag_ns = max(self.worst_lag_ns, lag_ns)
        if self._quiet_until_ns is None or over_ns + lag_ns >= self._quiet_until_ns:
            self._quiet_until_ns = over_ns + lag_ns + to_ns(REPEAT_S)
            self._say(
                f"real time: this machine does not keep up with {self.factor:g} x real time: "
                f"at tick {tick} the loop is {to_s(lag_ns):.3f} s behind"
            )

    def _span_ns(self, tick: int) -> int:
        """Simulated time from the start of the schedule to the end of a tick."""
        return tick_start_ns(tick + 1, self._rate_hz) - tick_start_ns(self._first_tick, self._rate_hz)
