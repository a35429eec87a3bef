"""`log.txt`: the messages of a run, each with its time."""

from pathlib import Path

from swarmwire.comms.clock import WallClock
from swarmwire.metrics.run_folder.layout import LOG


class RunLog:
    """Appends to a run folder's log; every line is in the file as soon as it was said.

    A log that cannot be written never disturbs a run: `lost` counts its lines.
    """

    def __init__(self, folder: Path, clock: WallClock | None = None) -> None:
        """Open the log of this run folder, which must be there; OSError if it cannot be written."""
        self.lost = 0
        self._clock = clock or WallClock()
        self._file = (folder / LOG).open("a", encoding="utf-8", buffering=1)

    def say(self, text: str) -> None:
        """Append a text; of several lines, those after the first are indented."""
        first, *more = text.rstrip("\n").split("\n")
        try:
            self._file.write(
                "\n".join([f"{self._clock.utc_stamp()} {first}", *(f"    {line}" for line in more)]) + "\n"
            )
        except OSError:
            self.lost += 1

    def close(self) -> None:
        """Close the file; safe to call more than once."""
        try:
            self._file.close()
        except OSError:
            self.lost += 1
