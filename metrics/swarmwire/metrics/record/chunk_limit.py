"""When what was gathered so far goes to disk: once it is much, or old."""

from swarmwire.comms.clock import Clock, to_ns

MAX_S = 2.0  # of wall time: a run that is killed loses no more than this, and the tick under way


class ChunkLimit:
    """Tells when a chunk is due that began when this was made or last `restart`ed."""

    def __init__(self, size: int, clock: Clock, share: float = 0.0) -> None:
        """It is due at this size, in rows or bytes, or 2 s of `clock` after it began.

        With a `share` it may also be that share of the time since this was made: of a long run there are few chunks.
        """
        self._size, self._clock, self._share = size, clock, share
        self._made_ns = clock.now_ns()
        self.restart()

    def restart(self) -> None:
        """A new chunk begins."""
        now_ns = self._clock.now_ns()
        self._due_ns = now_ns + max(to_ns(MAX_S), round(self._share * (now_ns - self._made_ns)))

    def reached(self, size: int) -> bool:
        """Whether a chunk of this size should be closed now."""
        return size >= self._size or self._clock.now_ns() >= self._due_ns
