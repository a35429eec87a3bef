"""Clocks that tests drive, and waiting for other threads and processes."""

from collections.abc import Callable
from threading import Event
from typing import TypeVar

from swarmwire.comms.base.clock import NS_PER_S, WallClock, to_ns

MS = NS_PER_S // 1000
ORIGIN_NS = 77  # clocks count from anywhere
TIMEOUT_S = 60.0  # of a machine that is busy: whatever holds does so in milliseconds
EACH_S = 0.005
T = TypeVar("T")


class FakeClock:
    """A clock that moves only when it is told to, or slept on."""

    def __init__(self) -> None:
        self.time_ns = ORIGIN_NS
        self.slept_until: list[int] = []

    def now_ns(self) -> int:
        return self.time_ns

    def sleep_until(self, at_ns: int) -> None:
        self.slept_until.append(at_ns)
        self.time_ns = max(self.time_ns, at_ns)

    def utc_stamp(self) -> str:
        """As `WallClock` tells the date."""
        return "20261121T030405Z"


class StillClock(FakeClock):
    """A clock on which nobody may sleep."""

    def sleep_until(self, at_ns: int) -> None:
        raise AssertionError("whatever looks on does not wait for the time")


class GoingClock(FakeClock):
    """A clock that goes on with each look."""

    def __init__(self, step_ns: int) -> None:
        super().__init__()
        self._step_ns = step_ns

    def now_ns(self) -> int:
        self.time_ns += self._step_ns
        return self.time_ns


def until(look: Callable[[], T], holds: Callable[[T], object] = bool) -> T:
    """What `look` returns as soon as it `holds`; AssertionError if it does not in a minute."""
    clock, pause = WallClock(), Event()
    end_ns = clock.now_ns() + to_ns(TIMEOUT_S)
    while not holds(value := look()):
        assert clock.now_ns() < end_ns, f"it did not come to hold; last seen: {value!r}"
        pause.wait(EACH_S)
    return value
