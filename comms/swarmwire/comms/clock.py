"""Time: integer nanoseconds, tick arithmetic, and the one place that reads the wall clock or sleeps."""

import time
from datetime import UTC, datetime
from typing import Protocol

NS_PER_S = 1_000_000_000  # all times are integers, in ns
LATE_WAKE_NS = 100_000  # by how much a sleep ends late, before it is known
MAX_AWAKE_NS = 500_000  # the longest that is waited awake: a machine that wakes later is busy, and others need it
FADES_IN = 16  # sleeps, about
SCALED_FROM_NS = 1_767_225_600 * NS_PER_S  # the first of January 2026: when all scaled clocks show the same date
SCALED_SPAN_NS = 10 * 365 * 86_400 * NS_PER_S  # after which they show it again: dates of ROS 2 end in 2038


def tick_start_ns(tick: int, rate_hz: int) -> int:
    """Start of a tick in ns since the start of the run: tick x 10^9 / rate, rounded down.

    >>> [tick_start_ns(tick, rate_hz=30) for tick in range(4)]
    [0, 33333333, 66666666, 100000000]
    """
    return tick * NS_PER_S // rate_hz


def to_ns(seconds: float) -> int:
    """A duration in s as the nearest whole number of ns."""
    return round(seconds * NS_PER_S)


def to_s(ns: int) -> float:
    """A time in ns as s."""
    return ns / NS_PER_S


class Clock(Protocol):
    """Whatever can tell the time and wait; injected, so that tests and lockstep need no wall clock."""

    def now_ns(self) -> int:
        """Monotonic time in ns from an arbitrary origin."""
        ...

    def sleep_until(self, at_ns: int) -> None:
        """Return once `now_ns()` has reached `at_ns`."""
        ...


class DatedClock(Clock, Protocol):
    """A clock that knows the date, too: what stamps made on several machines are compared by."""

    def utc_ns(self) -> int:
        """Time in ns since 1970, UTC; it may be set, and jump."""
        ...


class WallClock:
    """The machine's monotonic clock."""

    def now_ns(self) -> int:
        """Monotonic wall time in ns."""
        return time.perf_counter_ns()

    def sleep_until(self, at_ns: int) -> None:
        """Sleep until the monotonic clock shows `at_ns`."""
        left_ns = at_ns - self.now_ns()
        if left_ns > 0:
            time.sleep(left_ns / NS_PER_S)

    def utc_stamp(self) -> str:
        """The date and time now as 20261121T030405Z: for names of folders, never for a run."""
        return datetime.now(UTC).strftime("%Y%m%dT%H%M%SZ")

    def utc_ns(self) -> int:
        """Wall time in ns since 1970, UTC."""
        return time.time_ns()


class PreciseClock:
    """A clock whose sleeps end on time: it sleeps for less by what the machine takes to wake, and waits out the rest.

    What a wake takes is measured at each: the longest of late, which fades, so that one hiccup does not make every
    later sleep a busy wait.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock, self._wakes_late_ns = clock, LATE_WAKE_NS
        self.now_ns = clock.now_ns

    def sleep_until(self, at_ns: int) -> None:
        """Return once the clock shows `at_ns`, and hardly later."""
        early_ns = at_ns - self._wakes_late_ns
        if self.now_ns() < early_ns:
            self._clock.sleep_until(early_ns)
            late_ns = self.now_ns() - early_ns
            faded_ns = self._wakes_late_ns - self._wakes_late_ns // FADES_IN
            self._wakes_late_ns = min(max(faded_ns, late_ns), MAX_AWAKE_NS)
        while self.now_ns() < at_ns:
            continue


class ScaledClock:
    """A clock that runs `factor` times as fast as another: for agents of emulated robots in a world that does so."""

    def __init__(self, clock: DatedClock, factor: float) -> None:
        self._clock, self._factor = clock, factor
        self._began_ns = clock.now_ns()

    def now_ns(self) -> int:
        """Monotonic time in ns, which began with this object."""
        return round((self._clock.now_ns() - self._began_ns) * self._factor)

    def utc_ns(self) -> int:
        """A date in ns since 1970 that runs as fast, and is the same for all clocks of the same factor.

        It lies within ten years from 2026 on, and then begins anew: at 10 times the pace once in a year.
        """
        return SCALED_FROM_NS + round((self._clock.utc_ns() - SCALED_FROM_NS) * self._factor) % SCALED_SPAN_NS

    def sleep_until(self, at_ns: int) -> None:
        """Return once `now_ns()` has reached `at_ns`."""
        self._clock.sleep_until(self._began_ns + round(at_ns / self._factor))
