"""The table `events`: what the scenario made happen, a row per event and arena."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swarmwire.comms.clock import to_s
from swarmwire.comms.interfaces import Observer
from swarmwire.comms.truth import PacketCounts, Static, Truth
from swarmwire.metrics.event_log import names
from swarmwire.metrics.record.table_writer import Chunk, TableWriter

if TYPE_CHECKING:
    import polars as pl


class EventRecorder(Observer):
    """Observer that writes `events.parquet`; what happens in a tick is on disk soon after.

    Columns: at_s (of the scenario; of what happens singly, the tick's start), tick and time_s (in which it took
    effect), do, part (that fails, else empty), ended (whether it was undone then), arena, robots (the names of those
    it changed there). Arenas that have left have no row; nor, of what happens singly, have those in which nobody
    changed. Summary part: `record_events`: rows written and dropped.
    """

    def __init__(self, folder: Path, may_drop: bool = False) -> None:
        self._folder, self._may_drop = folder, may_drop

    def begin(self, static: Static) -> None:
        """Open the table."""
        self._static = static
        self._writer = TableWriter(self._folder, "events", event_schema(), self._may_drop)

    def see(self, truth: Truth) -> None:
        """Write what happened in this tick."""
        if not truth.events:
            return
        rows: list[dict[str, Any]] = [
            {
                "at_s": event.at_s,
                "tick": truth.tick,
                "time_s": to_s(truth.time_ns),
                "do": event.do,
                "part": event.part,
                "ended": event.ended,
                "arena": arena,
                "robots": robots,
            }
            for event in truth.events
            for arena, robots in enumerate(names(event, self._static))
            if truth.running[arena] and (robots or not event.singly)
        ]
        self._writer.put(Chunk(len(rows), partial(_frame, rows)))

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """Join the parts."""
        self._writer.close()
        return {"record_events": {"rows": self._writer.rows, "dropped": self._writer.dropped}}


def event_schema() -> "dict[str, Any]":
    """The type of each column."""
    import polars as pl

    return {
        "at_s": pl.Float64,
        "tick": pl.Int64,
        "time_s": pl.Float64,
        "do": pl.String,
        "part": pl.String,
        "ended": pl.Boolean,
        "arena": pl.Int32,
        "robots": pl.List(pl.String),
    }


def _frame(rows: list[dict[str, Any]]) -> "pl.DataFrame":
    import polars as pl

    return pl.DataFrame(rows, schema=event_schema())
