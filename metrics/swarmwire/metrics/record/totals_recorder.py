"""Tables that are totals over a run: added up while it goes on, written when it is over."""

from abc import ABC, abstractmethod
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from swarmwire.comms.errors import RecordFailed
from swarmwire.comms.interfaces import Observer
from swarmwire.comms.truth import PacketCounts, Static, Truth
from swarmwire.metrics.record.part_files import table_file, write_file

if TYPE_CHECKING:
    import polars as pl


class TotalsRecorder(Observer, ABC):
    """Observer that writes a table about the radio as the run ends; without a radio nothing. A killed run leaves none.

    Summary part: `record_NAME`: rows written, rows dropped (0: no disk is in the way of adding up). `end` raises
    RecordFailed if the disk refuses the table.
    """

    name: ClassVar[str]

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def begin(self, static: Static) -> None:
        """Start afresh."""
        self._has_radio = False
        self.start(static)

    def see(self, truth: Truth) -> None:
        """Add what a tick brought."""
        if truth.departed is not None and truth.finished is not None:
            self._has_radio = True
        self.add(truth)

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """Write the table."""
        if not self._has_radio:
            return {}
        frame = self.frame()
        try:
            write_file(frame, table_file(self._folder, self.name))
        except OSError as error:
            raise RecordFailed(f"{self._folder / self.name}: {error}") from error
        return {f"record_{self.name}": {"rows": len(frame), "dropped": 0, **self.about()}}

    @abstractmethod
    def start(self, static: Static) -> None:
        """Nothing is counted so far."""

    @abstractmethod
    def add(self, truth: Truth) -> None:
        """Add what a tick brought."""

    @abstractmethod
    def frame(self) -> "pl.DataFrame":
        """The table."""

    def about(self) -> dict[str, Any]:
        """What the summary says of the table besides."""
        return {}
