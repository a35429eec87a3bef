"""When the steps of an agent on a robot begin: by the clock, and never in a burst to catch up."""

from swarmwire.comms.clock import NS_PER_S, Clock, tick_start_ns


class Pacer:
    """Counts ticks of `rate_hz` from its start.

    A tick that begins later than a period after its time is late; those that went by meanwhile are skipped, so the
    number of the tick always tells the time. Two steps begin at least half a period apart: one that would not is
    skipped, too.

    Attributes:
        late: late ticks so far.
        skipped: ticks that went by without a step, since one took too long.
    """

    def __init__(self, clock: Clock, rate_hz: int) -> None:
        self._clock, self._rate_hz = clock, rate_hz
        self._started_ns = clock.now_ns()
        self._next = 0
        self.late = self.skipped = 0

    def since_start_ns(self) -> int:
        """Time since the first tick."""
        return self._clock.now_ns() - self._started_ns

    def wait(self) -> tuple[int, bool]:
        """Sleep until the next tick; its number, and whether it is late."""
        self._clock.sleep_until(self._started_ns + tick_start_ns(self._next, self._rate_hz))
        tick = max(self._next, self._newest())
        gone = tick - self._next
        self.late += gone > 0
        self.skipped += gone
        self._next = tick + 1
        if self._left_ns() * 2 < NS_PER_S // self._rate_hz:
            self._next += 1
            self.skipped += 1
        return tick, gone > 0

    def resume(self) -> int:
        """Go on after a pause that was meant: how many ticks it took, which are neither late nor skipped."""
        gone = max(0, self._newest() + 1 - self._next)
        self._next += gone
        return gone

    def _left_ns(self) -> int:
        """Time until the next tick."""
        return tick_start_ns(self._next, self._rate_hz) - self.since_start_ns()

    def _newest(self) -> int:
        """The newest tick whose time has come."""
        newest = self.since_start_ns() * self._rate_hz // NS_PER_S
        # The start of a tick is rounded down, so that it may be due a ns before the division says so.
        return newest + (tick_start_ns(newest + 1, self._rate_hz) <= self.since_start_ns())
