"""When the rows gathered so far go to disk: once they are many, or old."""

from swarmwire.comms.clock import Clock, to_ns

LONGEST_S = 2.0  # of wall time: a run that is killed loses no more than this, and the tick under way


class ChunkLimit:
    """Tells when a chunk is due that began when this was made or last `restart`ed."""

    def __init__(self, rows: int, clock: Clock) -> None:
        self._rows, self._clock = rows, clock
        self.restart()

    def restart(self) -> None:
        """A new chunk begins."""
        self._due_ns = self._clock.now_ns() + to_ns(LONGEST_S)

    def reached(self, rows: int) -> bool:
        """Whether a chunk of so many rows should be closed now."""
        return rows >= self._rows or self._clock.now_ns() >= self._due_ns
