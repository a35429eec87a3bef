"""Threads for independent parts of a tick. They change when something is computed, never what.

Parts are whole computations that share no memory that either writes to, so results do not depend on the number of
threads. Kernels that run beside others release the interpreter's lock (`nogil`).
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

T = TypeVar("T")

WORTH_ROWS = 10_000  # of a table: to hand over fewer takes longer than to work on them


class Threads:
    """So many threads, the caller's included."""

    def __init__(self, count: int = 1) -> None:
        self._others = ThreadPoolExecutor(count - 1, "swarmwire") if count > 1 else None

    def are_worth(self, rows: int) -> bool:
        """Whether there is another thread for work on so many rows."""
        return self._others is not None and rows >= WORTH_ROWS

    def start(self, work: Callable[[], T], rows: int) -> Callable[[], T]:
        """Begin work on so many rows; returns a function that waits for its result.

        It is done beside the caller's if that is worth it, else at once.
        """
        if self._others is not None and self.are_worth(rows):
            return self._others.submit(work).result
        done = work()
        return lambda: done
