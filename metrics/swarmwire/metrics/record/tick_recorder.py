"""The table `ticks`: poses, states, metrics and the radio's counts of every tick."""

from pathlib import Path
from typing import Any

from swarmwire.comms.clock import Clock
from swarmwire.comms.errors import BadInput
from swarmwire.comms.interfaces import Observer
from swarmwire.comms.truth import PacketCounts, Static, Truth
from swarmwire.metrics.measure import Metrics
from swarmwire.metrics.record.chunk_limit import ChunkLimit
from swarmwire.metrics.record.table_writer import Chunk, TableWriter
from swarmwire.metrics.record.tick_columns import (
    BYTES_PER_ROBOT,
    KEYS,
    RADIO,
    VALUE,
    TickColumns,
    movable_columns,
    robot_columns,
    tick_schema,
)

CHUNK_BYTES = 4_000_000
MAX_TICKS = 4096  # in a chunk, however small the swarm


class TickRecorder(Observer):
    """Observer that writes `ticks.parquet`, a row per tick and arena, without holding the loop up for the disk.

    An arena that has left has no more rows.

    Its metrics' columns are what `metrics` has measured, so that must see each tick before. Summary part:
    `record_ticks`: rows written, and rows dropped for want of time (in real time only). Raises RecordFailed once the
    disk refuses.
    """

    def __init__(self, folder: Path, metrics: Metrics, clock: Clock, may_drop: bool = False) -> None:
        """Record into this run folder; a chunk is closed by size, or 2 s of `clock` after it was begun."""
        self._folder, self._metrics, self._clock, self._may_drop = folder, metrics, clock, may_drop

    def begin(self, static: Static) -> None:
        """Open the table; BadInput if a metric is named like another column."""
        self._names = [metric.name for metric in self._metrics.metrics]
        for name in self._names:
            if name in (*KEYS, *robot_columns(static), VALUE, *movable_columns(static), *RADIO):
                raise BadInput("", f"metrics.{name}", "expected another name: ticks.parquet has a column of this name")
        self._static = static
        rows = static.arenas * static.robots
        self._ticks = min(MAX_TICKS, max(1, CHUNK_BYTES // (rows * BYTES_PER_ROBOT)))
        schema = tick_schema(static, self._names)
        self._writer = TableWriter(self._folder, "ticks", schema, self._may_drop)
        self._limit = ChunkLimit(self._ticks, self._clock)
        self._columns = self._new_columns()

    def see(self, truth: Truth) -> None:
        """Take one tick."""
        self._columns.add(truth, self._metrics.values)
        if self._limit.reached(self._columns.ticks):
            self._hand_over()

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """Write what is left and join the parts."""
        try:
            if self._columns.ticks:
                self._hand_over()
        finally:
            self._writer.close()
        return {"record_ticks": {"rows": self._writer.rows, "dropped": self._writer.dropped}}

    def _hand_over(self) -> None:
        columns, self._columns = self._columns, self._new_columns()
        self._writer.put(Chunk(columns.rows, columns.frame))
        self._limit.restart()

    def _new_columns(self) -> TickColumns:
        return TickColumns(self._static, self._names, self._ticks)
