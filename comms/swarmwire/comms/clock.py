"""Time: integer nanoseconds, tick arithmetic, and the one place that reads the wall clock or sleeps."""

import time
from datetime import UTC, datetime
from typing import Protocol

NS_PER_S = 1_000_000_000  # all times are integers, in ns


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
