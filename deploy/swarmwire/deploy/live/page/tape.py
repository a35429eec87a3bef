"""A growing recording that browsers read while it is written."""

import asyncio
import threading
from collections import deque
from collections.abc import AsyncGenerator
from itertools import islice


class Tape:
    """The parts of a recording: written by the thread that draws, read from the first part by any number of browsers.

    Above its limit the oldest parts are dropped, except the first, which contains the constants.
    """

    def __init__(self, limit_bytes: int) -> None:
        self._limit_bytes, self._bytes = limit_bytes, 0
        self._first: bytes | None = None
        self._parts: deque[bytes] = deque()  # later parts
        self._dropped = 0
        self._closed = False
        self._readers: dict[asyncio.Event, asyncio.AbstractEventLoop] = {}
        self._lock = threading.Lock()

    @property
    def readers(self) -> int:
        """Number of reading browsers, including those that wait for the next part."""
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
        """End the recording; readers end after its last part."""
        with self._lock:
            self._closed = True
            self._wake()

    async def read(self) -> AsyncGenerator[bytes]:
        """Yield all parts as they arrive, until the tape is closed; dropped parts are skipped."""
        more = asyncio.Event()
        with self._lock:
            self._readers[more] = asyncio.get_running_loop()
        try:
            written, closed = 0, False
            while not closed:
                more.clear()
                with self._lock:
                    parts, written = self._after(written)
                    closed = self._closed
                for part in parts:
                    yield part
                if not closed:
                    await more.wait()
        finally:
            with self._lock:
                del self._readers[more]

    def _after(self, count: int) -> tuple[list[bytes], int]:
        """Return the parts after the first `count` written parts, and the number of written parts."""
        if self._first is None:
            return [], 0
        first = [] if count else [self._first]
        later = islice(self._parts, max(count - 1 - self._dropped, 0), None)
        return [*first, *later], 1 + self._dropped + len(self._parts)

    def _wake(self) -> None:
        for more, loop in self._readers.items():
            loop.call_soon_threadsafe(more.set)
