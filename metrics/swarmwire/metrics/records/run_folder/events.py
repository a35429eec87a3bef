"""The events of a run: in its summary, and as the table `events`, a row per event and arena."""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import polars as pl

from swarmwire.comms.base.clock import to_s
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import EventRecord, Static, Truth
from swarmwire.comms.radio.records import PacketCounts
from swarmwire.metrics.records.run_folder.table import RecordedTable, RecordOptions, TableState, Verdict, arena_ticks
from swarmwire.metrics.records.run_folder.writer import Chunk, TableWriter, scan_files


class EventLog(Observer):
    """Observer that collects the events of a run. Summary part: `events`, in order.

    Each has at_s (time in the scenario; for singly events, the tick's start), tick (in which it took effect), do, part
    (that fails, else empty), ended (true if this is the event's end), singly (true if each robot has a separate time)
    and robots (names of the robots it changed, a list per arena).
    """

    def begin(self, static: Static) -> None:
        """Start a run."""
        self._static = static
        self._events: list[dict[str, Any]] = []

    def see(self, truth: Truth) -> None:
        """Add the events of a tick."""
        for event in truth.events:
            robots = event.changed_names(self._static)
            self._events.append({**_entry(event, truth), "singly": event.singly, "robots": robots})

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """Return the events so far."""
        return {"events": self._events}


def _entry(event: EventRecord, truth: Truth) -> dict[str, Any]:
    """Return the keys that the summary and the table share, for an event that took effect in this tick."""
    return {"at_s": event.at_s, "tick": truth.tick, "do": event.do, "part": event.part, "ended": event.ended}


MAX_STATED_EVENTS = 100_000  # upper bound of the events of a scenario and of live events


class Events(RecordedTable):
    """A row per event and arena.

    Columns: at_s (time in the scenario; for singly events, the tick's start), tick and time_s (in which it took
    effect), do, part (that fails, else empty), ended (true if this is the event's end), arena, robots (names of the
    robots it changed in the arena). Arenas that have left have no row. Events that change each robot at a separate time
    (`singly` in the summary) have rows only in arenas in which a robot changed.
    """

    name = "events"
    always = True

    types: ClassVar = {
        "at_s": pl.Float64,
        "tick": pl.Int64,
        "time_s": pl.Float64,
        "do": pl.String,
        "part": pl.String,
        "ended": pl.Boolean,
        "arena": pl.Int32,
        "robots": pl.List(pl.String),
    }

    def recorder(self, options: RecordOptions) -> Observer | None:
        """Return a recorder."""
        return EventRecorder(options.folder, options.may_drop)

    def max_rows(self, static: Static, ticks: int) -> int:
        """Return rows for begin and end of an event per robot and tick, and for the stated events."""
        return static.arenas * (2 * ticks * static.robots + MAX_STATED_EVENTS)

    def compare(self, files: list[Path], summary: Mapping[str, Any] | None) -> Verdict:
        """Compare the number of rows with the summary's events, by their arenas."""
        if summary is None:
            return None
        rows, events = scan_files(files).select(pl.len()).collect().item(), summary["events"]
        expected = sum(_row_count(event, arena_ticks(summary)) for event in events)
        if rows == expected:
            return None
        text = f"{rows} rows; the summary has {len(events)} events, {expected} rows by their arenas"
        return TableState.DIFFERS, text


class EventRecorder(Observer):
    """Observer that writes `events.parquet`; the rows of a tick are on disk soon after it.

    Summary part: `record_events`: rows written and dropped.
    """

    def __init__(self, folder: Path, may_drop: bool = False) -> None:
        self._folder, self._may_drop = folder, may_drop

    def begin(self, static: Static) -> None:
        """Open the table."""
        self._static = static
        self._writer = TableWriter(self._folder, "events", Events.types, self._may_drop)

    def see(self, truth: Truth) -> None:
        """Write the events of a tick."""
        if not truth.events:
            return
        rows: list[dict[str, Any]] = [
            {**_entry(event, truth), "time_s": to_s(truth.time_ns), "arena": arena, "robots": robots}
            for event in truth.events
            for arena, robots in enumerate(event.changed_names(self._static))
            if truth.running[arena] and (robots or not event.singly)
        ]
        self._writer.put(Chunk(len(rows), partial(pl.DataFrame, rows, schema=Events.types)))

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """Join the parts."""
        self._writer.close()
        return {"record_events": {"rows": self._writer.rows, "dropped": self._writer.dropped}}


def _row_count(event: Mapping[str, Any], ticks: list[int]) -> int:
    """Return the number of rows of an event of the summary; `ticks` is the number of ticks of each arena."""
    if not event["singly"]:
        return sum(event["tick"] < end for end in ticks)
    return 1 if len(ticks) == 1 else sum(bool(robots) for robots in event["robots"])
