"""Time: integer nanoseconds, tick arithmetic, and the clocks. Only this module reads the wall clock or sleeps.

Clocks are injected, so that tests and lockstep runs need no wall clock.
"""

import time
from datetime import UTC, datetime
from typing import Protocol

NS_PER_S = 1_000_000_000  # all times are integers, in ns
NEVER_NS = 2**63 - 1
DEFAULT_WAKE_LATENCY_NS = 100_000  # delay at the end of a sleep, until it is measured
MAX_BUSY_WAIT_NS = 500_000  # a machine that wakes later is busy: other processes need the time
WAKE_LATENCY_DECAY = 16  # number of sleeps in which a measured latency decays to a third
SCALED_FROM_NS = 1_767_225_600 * NS_PER_S  # 1 January 2026: all scaled clocks agree at this date
SCALED_SPAN_NS = 10 * 365 * 86_400 * NS_PER_S  # period of scaled dates: dates of ROS 2 end in 2038


def tick_start_ns(tick: int, rate_hz: int) -> int:
    """Start of a tick in ns since the start of the run: tick x 10^9 / rate, rounded down.

    >>> [tick_start_ns(tick, rate_hz=30) for tick in range(4)]
    [0, 33333333, 66666666, 100000000]
    """
    return tick * NS_PER_S // rate_hz


def to_ns(seconds: float) -> int:
    """Convert a duration in s to ns, rounded."""
    return round(seconds * NS_PER_S)


def to_s(ns: int) -> float:
    """Convert a time in ns to s."""
    return ns / NS_PER_S


class Clock(Protocol):
    """A source of time that can also wait."""

    def now_ns(self) -> int:
        """Monotonic time in ns from an arbitrary origin."""
        ...

    def sleep_until(self, at_ns: int) -> None:
        """Return once `now_ns()` has reached `at_ns`."""
        ...


class DatedClock(Clock, Protocol):
    """A clock that also has the date, by which time stamps of several machines are compared."""

    def utc_ns(self) -> int:
        """Time in ns since 1970, UTC; it jumps when the machine's clock is set."""
        ...


class WallClock:
    """The machine's monotonic clock."""

    def now_ns(self) -> int:
        """Monotonic wall time in ns."""
        return time.perf_counter_ns()

    def sleep_until(self, at_ns: int) -> None:
        """Sleep until the monotonic clock shows `at_ns`."""
        remaining_ns = at_ns - self.now_ns()
        if remaining_ns > 0:
            time.sleep(remaining_ns / NS_PER_S)

    def utc_stamp(self) -> str:
        """Return the date and time as 20261121T030405Z, for the names of folders; no run depends on it."""
        return datetime.now(UTC).strftime("%Y%m%dT%H%M%SZ")

    def utc_ns(self) -> int:
        """Wall time in ns since 1970, UTC."""
        return time.time_ns()


class PreciseClock:
    """A clock whose sleeps end on time: it sleeps shorter by the machine's wake latency, and busy-waits until then.

    It measures the wake latency at each sleep and uses the longest recent one. The maximum decays, so that one delay
    does not turn every later sleep into a busy wait.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock, self._wake_latency_ns = clock, DEFAULT_WAKE_LATENCY_NS
        self.now_ns = clock.now_ns

    def sleep_until(self, at_ns: int) -> None:
        """Return at `at_ns`, with little delay."""
        early_ns = at_ns - self._wake_latency_ns
        if self.now_ns() < early_ns:
            self._clock.sleep_until(early_ns)
            late_ns = self.now_ns() - early_ns
            faded_ns = self._wake_latency_ns - self._wake_latency_ns // WAKE_LATENCY_DECAY
            self._wake_latency_ns = min(max(faded_ns, late_ns), MAX_BUSY_WAIT_NS)
        while self.now_ns() < at_ns:
            continue


class ScaledClock:
    """A clock that runs `factor` times as fast as another, for agents of emulated robots in a world at that speed."""

    def __init__(self, clock: DatedClock, factor: float) -> None:
        self._clock, self._factor = clock, factor
        self._began_ns = clock.now_ns()

    def now_ns(self) -> int:
        """Monotonic time in ns since the clock was created."""
        return round((self._clock.now_ns() - self._began_ns) * self._factor)

    def utc_ns(self) -> int:
        """A date in ns since 1970 that runs at `factor` and is equal for all clocks of the same factor.

        It covers ten years from 2026 on and then begins again: at a factor of 10 once a year.
        """
        return SCALED_FROM_NS + round((self._clock.utc_ns() - SCALED_FROM_NS) * self._factor) % SCALED_SPAN_NS

    def sleep_until(self, at_ns: int) -> None:
        """Return once `now_ns()` has reached `at_ns`."""
        self._clock.sleep_until(self._began_ns + round(at_ns / self._factor))
