"""An inbox between the network's thread and a loop: it holds so much, and counts what it had no room for."""

import threading
from collections import deque
from typing import Generic, TypeVar

T = TypeVar("T")


class BoundedInbox(Generic[T]):
    """What arrived since the loop looked last, in order; when it is full, what arrives is lost, as in any receiver.

    Attributes:
        dropped: what it had no room for so far.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._waiting: deque[T] = deque()
        self._lock = threading.Lock()
        self.dropped = 0

    def put(self, item: T) -> None:
        """Called from the network's threads; it returns at once."""
        with self._lock:
            if len(self._waiting) < self._most:
                self._waiting.append(item)
            else:
                self.dropped += 1

    def take(self) -> list[T]:
        """All that waits, oldest first."""
        with self._lock:
            taken = list(self._waiting)
            self._waiting.clear()
        return taken
