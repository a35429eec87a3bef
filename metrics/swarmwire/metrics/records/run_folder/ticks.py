"""The table `ticks`: poses, states, metrics and the radio's counts of every tick; a row per tick and arena."""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from swarmwire.comms.base.arrays import AnyArray, FloatArray
from swarmwire.comms.base.clock import Clock, to_s
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Static, Truth
from swarmwire.comms.radio.records import PacketCounts
from swarmwire.comms.robot.bodies.drives import Holonomic
from swarmwire.comms.robot.packets import Fate
from swarmwire.metrics.measures.measure import Metrics
from swarmwire.metrics.records.run_folder.layout import (
    COMMAND,
    HEIGHT,
    KEYS,
    MOTION,
    MOVABLE,
    POSE,
    RADIO,
    ROBOT_COLUMNS,
    SIDEWAYS,
    VALUE,
    VELOCITY,
)
from swarmwire.metrics.records.run_folder.table import (
    RecordedTable,
    RecordOptions,
    TableState,
    Verdict,
    arena_ticks,
    per_arena,
)
from swarmwire.metrics.records.run_folder.writer import Chunk, ChunkLimit, TableWriter, scan_files

BYTES_PER_ROBOT = 4 * len(MOTION) + 1 + 4
CHUNK_BYTES = 32_000_000  # joining parts costs three times as much as writing them
MAX_TICKS = 4096  # per chunk, for small swarms


class Ticks(RecordedTable):
    """A row per tick and arena; lists have an item per robot in its order.

    Columns: tick, time_s, arena, seed; lists x_m, y_m, heading_rad, vx_mps, vy_mps, turn_radps (arena frame),
    command_forward_mps, command_turn_radps (within limits), command_left_mps if a robot can move sideways, and z_m
    (height of the lower side) if a source moves robots, all float32, alive, state ("": none noted); if a robot ever
    noted a number, value (float64; null: none yet); if obstacles are movable, lists movable_x_m, movable_y_m,
    movable_heading_rad with an item for each of them in the scenario's order; each metric (a count's total so far;
    null: undefined); sent, received, in_range since the previous tick (null without a radio).
    """

    name = "ticks"
    always = True
    optional = (VALUE,)

    def schema(self, static: Static | None = None) -> dict[str, Any]:
        """Return the type of each column except the metrics'."""
        return {} if static is None else tick_schema(static, (), with_value=True)

    def columns(self) -> Collection[str]:
        """Return the columns of every run."""
        return ("tick", "time_s", "arena", *ROBOT_COLUMNS)

    def recorder(self, options: RecordOptions) -> Observer | None:
        """Return a recorder."""
        return TickRecorder(options.folder, options.metrics, options.clock, options.may_drop)

    def max_rows(self, static: Static, ticks: int) -> int:
        """Return a row for each tick and arena."""
        return ticks * static.arenas

    def fault(self, table: pl.LazyFrame, static: Static | None) -> str | None:
        """Check the types only: values of metrics may be missing or not finite."""
        return self.type_fault(table, static)

    def reach(self, table: pl.LazyFrame) -> str:
        """Return the last tick in words."""
        tick, time_s = table.select(pl.col("tick").max(), pl.col("time_s").max()).collect().row(0)
        return f"up to tick {tick} ({time_s:g} s)"

    def compare(self, files: list[Path], summary: Mapping[str, Any] | None) -> Verdict:
        """Check that every arena has each tick once, from 0 to the last; compare the last metrics with the summary."""
        table = scan_files(files)
        tick = pl.col("tick")
        counts = pl.len().alias("rows"), tick.n_unique().alias("ticks"), tick.max().alias("last")
        counted = table.group_by("arena").agg(counts).sort("arena").collect()
        for arena, rows, ticks, last in counted.iter_rows():
            if not rows == ticks == last + 1:
                return TableState.PARTIAL, f"{last + 1 - ticks} ticks before the last are not there (arena {arena})"
        if summary is None or not (summary["ticks"] or len(counted)):  # the run may have ended before its first tick
            return None
        if len(counted) != summary["arenas"]:
            return TableState.DIFFERS, f"{len(counted)} arenas; the summary has {summary['arenas']}"
        for arena, (ticks, expected) in enumerate(zip(counted["ticks"], arena_ticks(summary), strict=True)):
            if ticks != expected:
                return TableState.DIFFERS, f"{ticks} ticks; the summary has {expected} (arena {arena})"
        return _compare_finals(table.filter(tick == tick.max().over("arena")).sort("arena").collect(), summary)


class TickRecorder(Observer):
    """Observer that writes `ticks.parquet`, a row per tick and arena, in a thread.

    An arena that has left has no more rows. The metrics' columns come from `metrics`, which must see each tick first.
    Summary part: `record_ticks`: rows written, and rows dropped because the disk was slow (in real time only). Raises
    RecordFailed if the disk cannot be written.
    """

    def __init__(self, folder: Path, metrics: Metrics, clock: Clock, may_drop: bool = False) -> None:
        """Record into this run folder; a chunk is written at a size, or 2 s of `clock` after its start."""
        self._folder, self._metrics, self._clock, self._may_drop = folder, metrics, clock, may_drop

    def begin(self, static: Static) -> None:
        """Open the table; BadInput if a metric has the name of another column."""
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
        """Add a tick."""
        self._columns.add(truth, self._metrics.values)
        if self._limit.reached(self._columns.ticks):
            self._write_chunk()

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """Write the last chunk and join the parts."""
        try:
            if self._columns.ticks:
                self._write_chunk()
        finally:
            self._writer.close()
        return {"record_ticks": {"rows": self._writer.rows, "dropped": self._writer.dropped}}

    def _write_chunk(self) -> None:
        columns, self._columns = self._columns, self._new_columns()
        self._writer.put(Chunk(columns.rows, columns.frame))
        self._limit.restart()

    def _new_columns(self) -> "TickColumns":
        return TickColumns(self._static, self._names, self._ticks)


class TickColumns:
    """Arrays (ticks, arenas, robots) or (ticks, arenas) for a chunk of ticks."""

    def __init__(self, static: Static, metrics: Sequence[str], ticks: int) -> None:
        shape = (ticks, static.arenas)
        robot_shape = (*shape, static.robots)
        self.ticks = 0  # number of filled ticks
        self._static, self._metrics = static, metrics
        self._running: AnyArray = np.empty(shape, np.bool_)
        self._tick: AnyArray = np.empty(ticks, np.int64)
        self._time_s: AnyArray = np.empty(ticks, np.float64)
        # The layout of the truth copies fastest; the writing thread splits it into columns.
        self._pose: AnyArray = np.empty((*robot_shape, len(POSE)), np.float32)
        self._velocity: AnyArray = np.empty((*robot_shape, len(VELOCITY)), np.float32)
        self._command: AnyArray = np.empty((*robot_shape, len(COMMAND) + 1), np.float32)
        self._height_m: AnyArray = np.empty(robot_shape if static.any_followed else (0, 0, 0), np.float32)
        self._movable: AnyArray = np.empty((*shape, static.movable, len(MOVABLE)), np.float32)
        self._alive: AnyArray = np.empty(robot_shape, np.bool_)
        self._state: AnyArray = np.empty(robot_shape, np.uint32)
        self._states: tuple[str, ...] = ("",)
        self._value: FloatArray | None = None  # allocated with the first value; NaN: none noted
        self._metric_values: AnyArray = np.empty((ticks, len(metrics), static.arenas), np.float64)
        self._radio: AnyArray = np.full((ticks, len(RADIO), static.arenas), np.nan)  # NaN without a radio

    def add(self, truth: Truth, metric_values: FloatArray) -> None:
        """Copy a tick, with the values of the metrics, (metrics, arenas)."""
        slot, shape = self.ticks, (self._static.arenas, self._static.robots)
        self._running[slot] = truth.running
        self._tick[slot], self._time_s[slot] = truth.tick, to_s(truth.time_ns)
        self._pose[slot] = truth.pose.reshape(*shape, -1)
        self._velocity[slot] = truth.velocity.reshape(*shape, -1)
        self._command[slot] = truth.command.reshape(*shape, -1)
        if self._static.any_followed and truth.height_m is not None:
            self._height_m[slot] = truth.height_m.reshape(shape)
        if truth.movable is not None:
            self._movable[slot] = truth.movable
        self._alive[slot] = truth.alive.reshape(shape)
        self._state[slot] = truth.state.reshape(shape)
        self._states = truth.states  # tuples of later ticks start with the same states
        if truth.value is not None:
            if self._value is None:
                self._value = np.full(self._alive.shape, np.nan)
            self._value[slot] = truth.value.reshape(shape)
        self._metric_values[slot] = metric_values
        if truth.tally is not None:
            self._radio[slot] = truth.tally.sent, truth.tally.fates[:, Fate.RECEIVED], truth.tally.in_range
        self.ticks += 1

    @property
    def rows(self) -> int:
        """Number of rows so far: one for each tick and arena that has not left."""
        return int(self._running[: self.ticks].sum())

    def frame(self) -> pl.DataFrame:
        """Return the rows so far, by tick and arena."""
        ticks, arenas, robots = self.ticks, self._static.arenas, self._static.robots
        per_robot = (ticks * arenas, robots)
        columns: dict[str, Any] = {
            "tick": np.repeat(self._tick[:ticks], arenas),
            "time_s": np.repeat(self._time_s[:ticks], arenas),
            "arena": np.tile(np.arange(arenas, dtype=np.int32), ticks),
            "seed": np.tile(np.array(self._static.seeds, np.int64), ticks),
        }
        schema = tick_schema(self._static, self._metrics, with_value=self._value is not None)
        command = (*COMMAND, SIDEWAYS) if SIDEWAYS in schema else COMMAND
        for names, values in ((POSE, self._pose), (VELOCITY, self._velocity), (command, self._command)):
            for index, name in enumerate(names):
                columns[name] = np.ascontiguousarray(values[:ticks, ..., index]).reshape(per_robot)
        if self._static.any_followed:
            columns[HEIGHT] = self._height_m[:ticks].reshape(per_robot)
        columns["alive"] = self._alive[:ticks].reshape(per_robot)
        columns["state"] = pl.Series(self._states).gather(self._state[:ticks].reshape(-1)).reshape(per_robot)
        if self._value is not None:
            columns[VALUE] = pl.Series(self._value[:ticks].reshape(-1), nan_to_null=True).reshape(per_robot)
        for index, name in enumerate(movable_columns(self._static)):
            columns[name] = np.ascontiguousarray(self._movable[:ticks, ..., index]).reshape(ticks * arenas, -1)
        for names, values in ((self._metrics, self._metric_values), (RADIO, self._radio)):
            for index, name in enumerate(names):
                numbers = np.ascontiguousarray(values[:ticks, index]).reshape(-1)
                columns[name] = pl.Series(numbers, nan_to_null=True).cast(schema[name])
        frame = pl.DataFrame(columns, schema=schema)
        running = self._running[:ticks].reshape(-1)
        return frame if running.all() else frame.filter(pl.Series(running))


def robot_columns(static: Static) -> tuple[str, ...]:
    """Return the columns that are lists with an item per robot."""
    sideways = any(isinstance(group.body.drive, Holonomic) for group in static.groups)
    heights = (HEIGHT,) if static.any_followed else ()
    return (*ROBOT_COLUMNS, *((SIDEWAYS,) if sideways else ()), *heights)


def movable_columns(static: Static) -> tuple[str, ...]:
    """Return the columns that are lists with an item per movable obstacle."""
    return MOVABLE if static.movable else ()


def _compare_finals(last: pl.DataFrame, summary: Mapping[str, Any]) -> Verdict:
    by_arena: list[dict[str, Any]] = per_arena(summary, "metrics")
    for arena, metrics in enumerate(by_arena):
        for name, statistics in metrics.items():
            value, final = last[name][arena] if name in last.columns else "no column", statistics["final"]
            if value != final:
                return TableState.DIFFERS, f"{name} ends at {value} (arena {arena}); the summary has {final}"
    return None


def tick_schema(static: Static, metrics: Sequence[str], *, with_value: bool = False) -> dict[str, Any]:
    """Return the type of each column for a run with these metrics."""
    robots = static.robots
    motion = [name for name in robot_columns(static) if name in MOTION]
    return {
        "tick": pl.Int64,
        "time_s": pl.Float64,
        "arena": pl.Int32,
        "seed": pl.Int64,
        **dict.fromkeys(motion, pl.Array(pl.Float32, robots)),
        "alive": pl.Array(pl.Boolean, robots),
        "state": pl.Array(pl.String, robots),
        **({VALUE: pl.Array(pl.Float64, robots)} if with_value else {}),
        **dict.fromkeys(movable_columns(static), pl.Array(pl.Float32, static.movable)),
        **dict.fromkeys(metrics, pl.Float64),
        **dict.fromkeys(RADIO, pl.Int64),
    }
