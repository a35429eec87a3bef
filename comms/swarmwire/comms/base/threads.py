"""Threads for independent parts of a tick. The number of threads changes no result.

Parts share no memory to which any of them writes. Kernels that run at the same time as others release the
interpreter's lock (`nogil`).
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

T = TypeVar("T")

WORTH_ROWS = 10_000  # length of a table from which a second thread saves time


class Threads:
    """A number of threads that includes the caller's."""

    def __init__(self, count: int = 1) -> None:
        self._others = ThreadPoolExecutor(count - 1, "swarmwire") if count > 1 else None

    def are_worth(self, rows: int) -> bool:
        """Return True if another thread exists and a table of `rows` is long enough for it."""
        return self._others is not None and rows >= WORTH_ROWS

    def start(self, work: Callable[[], T], rows: int) -> Callable[[], T]:
        """Begin work on a table of `rows`; return a function that waits for its result.

        Another thread does the work where that saves time, else the caller's does it at once.
        """
        if self._others is not None and self.are_worth(rows):
            return self._others.submit(work).result
        result = work()
        return lambda: result
