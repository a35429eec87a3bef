"""Wall time that this process spends on compiling kernels, which users see and which is no cost of a tick."""

from contextlib import ExitStack
from types import TracebackType
from typing import Self

from swarmwire.comms.base.clock import Clock
from swarmwire.comms.base.kernels import compile_events


class CompileTime:
    """A context that measures the wall time that numba spends on kernels whose machine code is not cached.

    numba compiles in one thread at a time. Any thread may read the time; a read at the moment at which a kernel begins
    or ends may be off by that kernel.
    """

    def __init__(self, clock: Clock) -> None:
        """Start with no time."""
        self._clock, self._events = clock, ExitStack()
        self._is_compiling = False
        self._start_ns = self._finished_ns = 0  # start of the present kernel; total of the kernels before it

    def __enter__(self) -> Self:
        self._events.enter_context(compile_events(self._start, self._end))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._events.close()

    def _start(self, depth: int) -> None:
        if depth == 0:
            self._start_ns, self._is_compiling = self._clock.now_ns(), True

    def _end(self, depth: int) -> None:
        if depth == 0:
            self._is_compiling = False
            self._finished_ns += self._clock.now_ns() - self._start_ns

    def total_ns(self) -> int:
        """Return the total up to now, including the present kernel."""
        return self._finished_ns + (self._clock.now_ns() - self._start_ns if self._is_compiling else 0)
