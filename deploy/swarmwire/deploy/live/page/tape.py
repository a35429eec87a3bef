"""A recording that grows, for browsers that read it while it does."""

import asyncio
import threading
from collections import deque
from collections.abc import AsyncGenerator
from itertools import islice


class Tape:
    """The parts of a recording: written by the thread that draws, read by any number of browsers from the first on.

    Above its limit the oldest parts are dropped, but for the first, which holds the constants.
    """

    def __init__(self, limit_bytes: int) -> None:
        self._limit_bytes, self._bytes = limit_bytes, 0
        self._first: bytes | None = None
        self._parts: deque[bytes] = deque()  # after the first
        self._dropped = 0
        self._closed = False
        self._readers: dict[asyncio.Event, asyncio.AbstractEventLoop] = {}
        self._lock = threading.Lock()

    @property
    def readers(self) -> int:
        """How many browsers read it now; also those that wait for its next part."""
        return len(self._readers)

    def write(self, part: bytes) -> None:
        """Append a part."""
        with self._lock:
            if self._first is None:
                self._first = part
            else:
                self._parts.append(part)
                self._bytes += len(part)
            while self._bytes > self._limit_bytes:
                self._bytes -= len(self._parts.popleft())
                self._dropped += 1
            self._wake()

    def close(self) -> None:
        """Append no more: readers end once they have read what there is."""
        with self._lock:
            self._closed = True
            self._wake()

    async def read(self) -> AsyncGenerator[bytes]:
        """All parts, as they come, until it is closed; parts that are dropped before they are read are left out."""
        more = asyncio.Event()
        with self._lock:
            self._readers[more] = asyncio.get_running_loop()
        try:
            passed, closed = 0, False
            while not closed:
                more.clear()
                with self._lock:
                    parts, passed = self._after(passed)
                    closed = self._closed
                for part in parts:
                    yield part
                if not closed:
                    await more.wait()
        finally:
            with self._lock:
                del self._readers[more]

    def _after(self, passed: int) -> tuple[list[bytes], int]:
        """The parts that follow on so many of all that were written, and how many were written."""
        if self._first is None:
            return [], 0
        first = [] if passed else [self._first]
        later = islice(self._parts, max(passed - 1 - self._dropped, 0), None)
        return [*first, *later], 1 + self._dropped + len(self._parts)

    def _wake(self) -> None:
        for more, loop in self._readers.items():
            loop.call_soon_threadsafe(more.set)
