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
MAX_TICKS = 4096  # in a chunk, however small the swarm


class Ticks(RecordedTable):
    """A row per tick and arena; lists have an item per robot in its order.

    Columns: tick, time_s, arena, seed; lists x_m, y_m, heading_rad, vx_mps, vy_mps, turn_radps (arena frame),
    command_forward_mps, command_turn_radps (as applied) and, if a robot can move sideways, command_left_mps, all
    float32, alive, state ("": none named); if a robot ever noted a number, value (float64; null: none yet); if
    obstacles are movable, lists movable_x_m, movable_y_m, movable_heading_rad with an item for each of them in the
    scenario's order; each metric (a count's total so far; null: undefined); sent, received, in_range since the tick
    before (null without a radio).
    """

    name = "ticks"
    always = True
    optional = (VALUE,)

    def schema(self, static: Static | None = None) -> dict[str, Any]:
        """The type of each column but the metrics'."""
        return {} if static is None else tick_schema(static, (), with_value=True)

    def columns(self) -> Collection[str]:
        """The columns of every run."""
        return ("tick", "time_s", "arena", *ROBOT_COLUMNS)

    def recorder(self, options: RecordOptions) -> Observer | None:
        """A recorder."""
        return TickRecorder(options.folder, options.metrics, options.clock, options.may_drop)

    def max_rows(self, static: Static, ticks: int) -> int:
        """One for each tick and arena."""
        return ticks * static.arenas

    def fault(self, table: pl.LazyFrame, static: Static | None) -> str | None:
        """The types alone: values of metrics may be missing or not finite."""
        return self.type_fault(table, static)

    def reach(self, table: pl.LazyFrame) -> str:
        """The last tick."""
        tick, time_s = table.select(pl.col("tick").max(), pl.col("time_s").max()).collect().row(0)
        return f"up to tick {tick} ({time_s:g} s)"

    def compare(self, files: list[Path], summary: Mapping[str, Any] | None) -> Verdict:
        """Every tick once in every arena, from 0 to the last; the last row's metrics are the final ones."""
        table = scan_files(files)
        tick = pl.col("tick")
        counts = pl.len().alias("rows"), tick.n_unique().alias("ticks"), tick.max().alias("last")
        counted = table.group_by("arena").agg(counts).sort("arena").collect()
        for arena, rows, ticks, last in counted.iter_rows():
            if not rows == ticks == last + 1:
                return TableState.PARTIAL, f"{last + 1 - ticks} ticks before the last are not there (arena {arena})"
        if summary is None or not (summary["ticks"] or len(counted)):  # it may end before its first tick
            return None
        if len(counted) != summary["arenas"]:
            return TableState.DIFFERS, f"{len(counted)} arenas; the summary has {summary['arenas']}"
        for arena, (found, expected) in enumerate(zip(counted["ticks"], arena_ticks(summary), strict=True)):
            if found != expected:
                return TableState.DIFFERS, f"{found} ticks; the summary has {expected} (arena {arena})"
        return _compare_finals(table.filter(tick == tick.max().over("arena")).sort("arena").collect(), summary)


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

    def _new_columns(self) -> "TickColumns":
        return TickColumns(self._static, self._names, self._ticks)


class TickColumns:
    """Room for `ticks` ticks, in arrays (ticks, arenas, robots) or (ticks, arenas)."""

    def __init__(self, static: Static, metrics: Sequence[str], ticks: int) -> None:
        shape = (ticks, static.arenas)
        of_robots = (*shape, static.robots)
        self.ticks = 0  # filled
        self._static, self._metrics = static, metrics
        self._running: AnyArray = np.empty(shape, np.bool_)
        self._tick: AnyArray = np.empty(ticks, np.int64)
        self._time_s: AnyArray = np.empty(ticks, np.float64)
        # As the truth has them, which copies fastest; the thread that writes puts them in columns.
        self._pose: AnyArray = np.empty((*of_robots, len(POSE)), np.float32)
        self._velocity: AnyArray = np.empty((*of_robots, len(VELOCITY)), np.float32)
        self._command: AnyArray = np.empty((*of_robots, len(COMMAND) + 1), np.float32)
        self._movable: AnyArray = np.empty((*shape, static.movable, len(MOVABLE)), np.float32)
        self._alive: AnyArray = np.empty(of_robots, np.bool_)
        self._state: AnyArray = np.empty(of_robots, np.uint32)
        self._states: tuple[str, ...] = ("",)
        self._value: FloatArray | None = None  # made once it is needed, of_robots; NaN: none told
        self._measured: AnyArray = np.empty((ticks, len(metrics), static.arenas), np.float64)
        self._radio: AnyArray = np.full((ticks, len(RADIO), static.arenas), np.nan)  # which it stays without a radio

    def add(self, truth: Truth, measured: FloatArray) -> None:
        """Copy a tick, with what the metrics say of it, (metrics, arenas)."""
        at, shape = self.ticks, (self._static.arenas, self._static.robots)
        self._running[at] = truth.running
        self._tick[at], self._time_s[at] = truth.tick, to_s(truth.time_ns)
        self._pose[at] = truth.pose.reshape(*shape, -1)
        self._velocity[at] = truth.velocity.reshape(*shape, -1)
        self._command[at] = truth.command.reshape(*shape, -1)
        if truth.movable is not None:
            self._movable[at] = truth.movable
        self._alive[at] = truth.alive.reshape(shape)
        self._state[at] = truth.state.reshape(shape)
        self._states = truth.states  # it only grows
        if truth.value is not None:
            if self._value is None:
                self._value = np.full(self._alive.shape, np.nan)
            self._value[at] = truth.value.reshape(shape)
        self._measured[at] = measured
        if truth.tally is not None:
            self._radio[at] = truth.tally.sent, truth.tally.fates[:, Fate.RECEIVED], truth.tally.in_range
        self.ticks += 1

    @property
    def rows(self) -> int:
        """How many are filled: one for each tick and arena that has not left."""
        return int(self._running[: self.ticks].sum())

    def frame(self) -> pl.DataFrame:
        """The rows filled so far, by tick and arena."""
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
            for place, name in enumerate(names):
                columns[name] = np.ascontiguousarray(values[:ticks, ..., place]).reshape(per_robot)
        columns["alive"] = self._alive[:ticks].reshape(per_robot)
        columns["state"] = pl.Series(self._states).gather(self._state[:ticks].reshape(-1)).reshape(per_robot)
        if self._value is not None:
            columns[VALUE] = pl.Series(self._value[:ticks].reshape(-1), nan_to_null=True).reshape(per_robot)
        for place, name in enumerate(movable_columns(self._static)):
            columns[name] = np.ascontiguousarray(self._movable[:ticks, ..., place]).reshape(ticks * arenas, -1)
        for names, values in ((self._metrics, self._measured), (RADIO, self._radio)):
            for place, name in enumerate(names):
                numbers = np.ascontiguousarray(values[:ticks, place]).reshape(-1)
                columns[name] = pl.Series(numbers, nan_to_null=True).cast(schema[name])
        whole = pl.DataFrame(columns, schema=schema)
        running = self._running[:ticks].reshape(-1)
        return whole if running.all() else whole.filter(pl.Series(running))


def robot_columns(static: Static) -> tuple[str, ...]:
    """The columns that are lists with an item per robot."""
    sideways = any(isinstance(group.body.drive, Holonomic) for group in static.groups)
    return (*ROBOT_COLUMNS, SIDEWAYS) if sideways else ROBOT_COLUMNS


def movable_columns(static: Static) -> tuple[str, ...]:
    """The columns that are lists with an item per movable obstacle."""
    return MOVABLE if static.movable else ()


def _compare_finals(last: pl.DataFrame, summary: Mapping[str, Any]) -> Verdict:
    measured: list[dict[str, Any]] = per_arena(summary, "metrics")
    for arena, metrics in enumerate(measured):
        for name, statistics in metrics.items():
            found = last[name][arena] if name in last.columns else "no column"
            if found != statistics["final"]:
                return (
                    TableState.DIFFERS,
                    f"{name} ends at {found} (arena {arena}); the summary has {statistics['final']}",
                )
    return None


def tick_schema(static: Static, metrics: Sequence[str], *, with_value: bool = False) -> "dict[str, Any]":
    """The type of each column, for a run of these robots and movable obstacles with these metrics."""
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
