"""The commands that come for one base, from whatever program."""

import threading
from collections import Counter
from collections.abc import Callable

from swarmwire.comms.clock import Clock
from swarmwire.comms.errors import BadFrame
from swarmwire.comms.robots.ros2.messages import Velocities

REST = Velocities(0.0, 0.0)


class CommandInbox:
    """Keeps the newest command, and stops a base that gets none for a while, as real ones do.

    Attributes:
        is_open: whether commands are taken; the dead take none.
    """

    def __init__(self, timeout_ns: int, clock: Clock) -> None:
        self.is_open = True
        self._counts: Counter[str] = Counter()
        self._timeout_ns, self._clock = timeout_ns, clock
        self._lock = threading.Lock()
        self._came: tuple[int, Velocities] | None = None  # the newest that was not taken yet, and when
        self._until_ns: int | None = None  # when a base that drives will stop by itself
        self._rests = False  # it is to be told so before anything else

    def take(self, payload: bytes, decode: Callable[[bytes], Velocities]) -> None:
        """A command came; it is counted instead if it cannot be read."""
        try:
            told = decode(payload)
        except BadFrame as error:
            self.refuse(error.fault)
            return
        with self._lock:
            if self.is_open:
                self._came = self._clock.now_ns(), told

    def refuse(self, fault: str) -> None:
        """Count what is no command."""
        with self._lock:
            self._counts[fault] += 1

    def counts(self) -> Counter[str]:
        """What was refused so far, and how often the base stopped by itself, by name."""
        with self._lock:
            return self._counts.copy()

    def newest(self) -> Velocities | None:
        """The command that holds from now on; None: still the one before."""
        now_ns = self._clock.now_ns()
        with self._lock:
            if self._rests:
                self._rests = False
                return REST
            came, self._came = self._came, None
            if came is not None:
                at_ns, told = came
                self._until_ns = at_ns + self._timeout_ns if told != REST else None
                return told
            if self._until_ns is not None and now_ns >= self._until_ns:
                self._until_ns = None
                self._counts["command_timeouts"] += 1
                return REST
        return None

    def forget(self) -> None:
        """Be at rest, and drop what waits: the base died."""
        with self._lock:
            self._came = self._until_ns = None
            self._rests = True
