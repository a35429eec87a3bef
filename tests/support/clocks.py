"""Clocks that a test moves."""

from swarmwire.comms.clock import NS_PER_S

MS = NS_PER_S // 1000
ORIGIN_NS = 77  # clocks count from anywhere


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
