"""The events of a run: in its summary, and as the table `events`, a row per event and arena."""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import polars as pl

from swarmwire.comms.base.clock import to_s
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import EventRecord, Static, Truth
from swarmwire.comms.radio.records import PacketCounts
from swarmwire.metrics.records.run_folder.table import RecordedTable, RecordOptions, TableState, Verdict, arena_ticks
from swarmwire.metrics.records.run_folder.writer import Chunk, TableWriter, scan_files


class EventLog(Observer):
    """Observer that keeps what happened. Summary part: `events`, in order.

    Each: at_s (of the scenario; of what happens singly, the tick's start), tick (in which it took effect), do, part
    (that fails, else empty), ended (whether it was undone then), singly (each robot at a time of its own) and robots:
    the names of those it changed, a list per arena.
    """

    def begin(self, static: Static) -> None:
        """Start afresh."""
        self._static = static
        self._events: list[dict[str, Any]] = []

    def see(self, truth: Truth) -> None:
        """Add what happened in a tick."""
        for event in truth.events:
            robots = names(event, self._static)
            self._events.append({**_entry(event, truth), "singly": event.singly, "robots": robots})

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """The events so far."""
        return {"events": self._events}


def _entry(event: EventRecord, truth: Truth) -> dict[str, Any]:
    """What the summary and the table have of an event, in the tick in which it took effect."""
    return {"at_s": event.at_s, "tick": truth.tick, "do": event.do, "part": event.part, "ended": event.ended}


STATED_EVENTS = 100_000  # that a scenario and the people who watch the run can have stated


class Events(RecordedTable):
    """A row per event and arena.

    Columns: at_s (of the scenario; of what happens singly, the tick's start), tick and time_s (in which it took
    effect), do, part (that fails, else empty), ended (whether it was undone then), arena, robots (the names of those
    it changed there). Arenas that have left have no row; nor, of what happens to each robot at a time of its own
    (`singly` in the summary), have those in which no robot changed.
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
        """A recorder."""
        return EventRecorder(options.folder, options.may_drop)

    def max_rows(self, static: Static, ticks: int) -> int:
        """Begin and end of one for each robot and tick, and those that a scenario or a person states."""
        return static.arenas * (2 * ticks * static.robots + STATED_EVENTS)

    def compare(self, files: list[Path], summary: Mapping[str, Any] | None) -> Verdict:
        """A row for each event of the summary in each arena that it concerns."""
        if summary is None:
            return None
        rows, events = scan_files(files).select(pl.len()).collect().item(), summary["events"]
        expected = sum(_arenas_of(event, arena_ticks(summary)) for event in events)
        if rows != expected:
            return (
                TableState.DIFFERS,
                f"{rows} rows; the summary has {len(events)} events, {expected} rows by their arenas",
            )
        return None


class EventRecorder(Observer):
    """Observer that writes `events.parquet`; what happens in a tick is on disk soon after.

    Summary part: `record_events`: rows written and dropped.
    """

    def __init__(self, folder: Path, may_drop: bool = False) -> None:
        self._folder, self._may_drop = folder, may_drop

    def begin(self, static: Static) -> None:
        """Open the table."""
        self._static = static
        self._writer = TableWriter(self._folder, "events", Events.types, self._may_drop)

    def see(self, truth: Truth) -> None:
        """Write what happened in this tick."""
        if not truth.events:
            return
        rows: list[dict[str, Any]] = [
            {**_entry(event, truth), "time_s": to_s(truth.time_ns), "arena": arena, "robots": robots}
            for event in truth.events
            for arena, robots in enumerate(names(event, self._static))
            if truth.running[arena] and (robots or not event.singly)
        ]
        self._writer.put(Chunk(len(rows), partial(pl.DataFrame, rows, schema=Events.types)))

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """Join the parts."""
        self._writer.close()
        return {"record_events": {"rows": self._writer.rows, "dropped": self._writer.dropped}}


def names(event: EventRecord, static: Static) -> list[list[str]]:
    """The names of the robots that an event changed, a list per arena."""
    changed = event.changed.reshape(static.arenas, static.robots)
    return [[static.robot_names[index] for index in np.flatnonzero(own)] for own in changed]


def _arenas_of(event: Mapping[str, Any], ticks: list[int]) -> int:
    """In how many arenas, of so many ticks, an event of the summary has a row."""
    if not event["singly"]:
        return sum(event["tick"] < done for done in ticks)
    return 1 if len(ticks) == 1 else sum(bool(robots) for robots in event["robots"])
