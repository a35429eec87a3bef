"""The wall time in which this process compiles kernels: it is no cost of a tick, and is shown to people."""

from types import TracebackType
from typing import Self

from numba.core import event

from swarmwire.comms.base.clock import Clock
from swarmwire.deploy.host import COMPILE


class CompileTime(event.Listener):
    """While entered, the wall time that numba spends on kernels that it does not find compiled.

    numba compiles in one thread at a time. Any thread may read; one that reads in the moment in which a kernel begins
    or ends may be off by that kernel.
    """

    def __init__(self, clock: Clock) -> None:
        """Nothing compiled yet."""
        self._clock = clock
        self._depth = 0  # compiling one kernel compiles those that it calls
        self._began_ns = self._ended_ns = 0  # the kernel under way; all before it

    def __enter__(self) -> Self:
        event.register(COMPILE, self)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        event.unregister(COMPILE, self)

    def on_start(self, event: event.Event) -> None:
        """Count from now, unless within another kernel."""
        if self._depth == 0:
            self._began_ns = self._clock.now_ns()
        self._depth += 1

    def on_end(self, event: event.Event) -> None:
        """Add what it took."""
        self._depth -= 1
        if self._depth == 0:
            self._ended_ns += self._clock.now_ns() - self._began_ns

    def total_ns(self) -> int:
        """So far, with the kernel under way."""
        return self._ended_ns + (self._clock.now_ns() - self._began_ns if self._depth else 0)
