"""Wall time that this process spends on compiling kernels: no cost of a tick, and shown to users."""

from contextlib import ExitStack
from types import TracebackType
from typing import Self

from swarmwire.comms.base.clock import Clock
from swarmwire.comms.base.kernels import compile_events


class CompileTime:
    """While entered, the wall time that numba spends on kernels whose machine code is not cached.

    numba compiles in one thread at a time. Any thread may read; one that reads at the moment at which a kernel begins
    or ends may be off by that kernel.
    """

    def __init__(self, clock: Clock) -> None:
        """Start with no time."""
        self._clock, self._events = clock, ExitStack()
        self._is_compiling = False
        self._began_ns = self._ended_ns = 0  # start of the kernel under way; total of all before it

    def __enter__(self) -> Self:
        self._events.enter_context(compile_events(self._start, self._end))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._events.close()

    def _start(self, depth: int) -> None:
        if depth == 0:
            self._began_ns, self._is_compiling = self._clock.now_ns(), True

    def _end(self, depth: int) -> None:
        if depth == 0:
            self._is_compiling = False
            self._ended_ns += self._clock.now_ns() - self._began_ns

    def total_ns(self) -> int:
        """Return the total up to now, including the kernel under way."""
        return self._ended_ns + (self._clock.now_ns() - self._began_ns if self._is_compiling else 0)
