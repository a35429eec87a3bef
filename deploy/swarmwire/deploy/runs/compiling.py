"""Compiling of kernels in this process: its wall time, which is no cost of a tick, and lines about it for users."""

import threading
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from types import TracebackType
from typing import Self

from rich.console import Console

from swarmwire.comms.base.clock import Clock, WallClock, to_s
from swarmwire.comms.base.kernels import compile_events

FIRST_LINE_S = 2.0  # time of compiling before a line reports it
LINE_INTERVAL_S = 5.0  # time from one line to the next
COMPILING = "compiling kernels that this machine does not have yet: for a minute or so, then they are kept"


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


@contextmanager
def report_compiling(
    console: Console, after_s: float = FIRST_LINE_S, interval_s: float = LINE_INTERVAL_S
) -> Generator[None]:
    """Print a line once kernels have compiled for `after_s` within the context, then their number each `interval_s`."""
    lines = _CompileLines(console, after_s, interval_s)
    with compile_events(lines.start, lines.end):
        yield


class _CompileLines:
    """The lines of `report_compiling`, printed while a kernel compiles, or after it."""

    def __init__(self, console: Console, after_s: float, interval_s: float) -> None:
        self._console, self._interval_s = console, interval_s
        self._clock, self._lock = WallClock(), threading.Lock()
        self._remaining_s = after_s  # time of compiling before the next line
        self._kernels = 0
        self._is_compiling = self._has_printed = False

    def start(self, depth: int) -> None:
        with self._lock:
            self._kernels += 1
            if depth == 0:
                self._is_compiling = True
                self._wait()

    def end(self, depth: int) -> None:
        with self._lock:
            if depth == 0:
                self._is_compiling = False
                self._timer.cancel()
                self._remaining_s -= to_s(self._clock.now_ns() - self._start_ns)
                if self._remaining_s <= 0:
                    self._print_line()

    def _wait(self) -> None:
        self._start_ns = self._clock.now_ns()
        self._timer = threading.Timer(self._remaining_s, self._print_meanwhile)
        self._timer.daemon = True
        self._timer.start()

    def _print_meanwhile(self) -> None:
        with self._lock:
            if self._is_compiling and self._timer is threading.current_thread():
                self._print_line()
                self._wait()

    def _print_line(self) -> None:
        text = f"{self._kernels} kernels so far" if self._has_printed else COMPILING
        self._console.print(text, soft_wrap=True, highlight=False)
        self._has_printed, self._remaining_s = True, self._interval_s
