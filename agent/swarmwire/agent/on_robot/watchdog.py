"""The watchdog of an agent on a robot: motors off when the loop has not fed it for too long."""

import threading
from collections.abc import Callable

from swarmwire.comms.clock import Clock, to_ns, to_s

LOOKS = 5  # in the time that it allows
SHORTEST_LOOK_S = 0.01  # also of a robot that is emulated far faster than the wall clock


class Watchdog:
    """A thread of its own that stops the motors, once in a lapse; it rests until it is fed.

    Each time it looks it calls `beat`, so that the guard outside knows that this process runs.

    Attributes:
        stops: how often it stopped the motors so far.
    """

    def __init__(
        self,
        after_s: float,
        stop: Callable[[], None],
        clock: Clock,
        pace: float = 1.0,
        beat: Callable[[], None] = lambda: None,
        tell: Callable[[float], None] = lambda _: None,
    ) -> None:
        """`tell` is told for how many seconds nothing was heard of the loop, once the motors were stopped for it."""
        self._after_ns, self._stop, self._clock = to_ns(after_s), stop, clock
        self._look_s = max(after_s / LOOKS / pace, SHORTEST_LOOK_S)  # of wall time
        self._beat, self._tell = beat, tell
        self._fed_ns: int | None = None  # None: it rests
        self._lapsed_ns: int | None = None  # when it was fed last before it stopped the motors
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="watchdog", daemon=True)
        self.stops = 0

    def start(self) -> None:
        """Begin to look, and beat at once: from now on motors may move."""
        self._beat()
        self._thread.start()

    def feed(self) -> None:
        """The loop is there: from now on it has its time again."""
        self._fed_ns = self._clock.now_ns()

    def rest(self) -> None:
        """Nothing is expected until it is fed again: the motors are at rest, or cannot be reached."""
        self._fed_ns = None

    def look(self) -> None:
        """Stop the motors if the loop has not been heard of for too long."""
        fed_ns = self._fed_ns
        if fed_ns is None or fed_ns == self._lapsed_ns or (silent_ns := self._clock.now_ns() - fed_ns) < self._after_ns:
            return
        self._lapsed_ns = fed_ns
        self._stop()
        self.stops += 1
        self._tell(to_s(silent_ns))

    def end(self) -> None:
        """Look no more; safe to call more than once, and before `start`."""
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        while not self._ended.wait(self._look_s):
            self.look()
            self._beat()
