"""What a run leaves behind: its folder, from the first line of the log to the summary."""

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from swarmwire.comms.clock import WallClock
from swarmwire.comms.protocols import Observer
from swarmwire.deploy.folder import make_folder
from swarmwire.deploy.recording import Recording
from swarmwire.deploy.result import Result
from swarmwire.metrics.metrics import Metrics
from swarmwire.metrics.record.run_log import RunLog


class RunRecord:
    """The folder of one run, or, with `out` None, nothing but what people are told.

    Attributes:
        folder: the run folder, if any.
        observers: those that fill it.
    """

    def __init__(self, out: Path | None, what: Recording, metrics: Metrics, clock: WallClock, may_drop: bool) -> None:
        """Make the folder; BadInput unless it is new or empty, or can be made."""
        self.folder = None if out is None else make_folder(out)
        self._log = RunLog(self.folder, clock) if self.folder else None
        self.observers: Sequence[Observer] = (
            what.observers(self.folder, metrics, clock, may_drop) if self.folder else ()
        )

    def say(self, text: str) -> None:
        """Tell people at once, and keep it in the log."""
        print(text, file=sys.stderr, flush=True)
        self.note(text)

    def note(self, text: str) -> None:
        """Keep it in the log."""
        if self._log:
            self._log.say(text)

    def close(self, result: Result) -> None:
        """Write the summary, the last of all: where it is, the run is over."""
        self.note(f"ended: {result.ended}, {result.ticks} ticks" + (f": {result.error}" if result.error else ""))
        if self._log:
            self._log.close()
        if self.folder:
            result.write(self.folder / "summary.json")


def dropped_rows(record: Mapping[str, Mapping[str, Any]]) -> dict[str, int]:
    """Rows that a slow disk cost, by name, as they are counted in the summary."""
    return {f"rows_dropped_{table}": of["dropped"] for table, of in record.items() if of["dropped"]}
