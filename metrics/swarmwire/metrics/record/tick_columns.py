"""The table of ticks: its columns, and a chunk of them being filled. One row per tick and arena."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from swarmwire.comms.arrays import AnyArray, FloatArray
from swarmwire.comms.bodies.drives import Holonomic
from swarmwire.comms.clock import to_s
from swarmwire.comms.packets import Fate
from swarmwire.comms.truth import Static, Truth

if TYPE_CHECKING:
    import polars as pl

POSE = ("x_m", "y_m", "heading_rad")  # arena frame
VELOCITY = ("vx_mps", "vy_mps", "turn_radps")  # arena frame
COMMAND = ("command_forward_mps", "command_turn_radps")  # as applied
SIDEWAYS = "command_left_mps"  # as applied; only where a robot can move so
MOTION = (*POSE, *VELOCITY, *COMMAND, SIDEWAYS)  # lists with a number per robot, float32
ROBOT_COLUMNS = (*POSE, *VELOCITY, *COMMAND, "alive", "state")  # lists with an item per robot, in every record
VALUE = "value"  # a list with a number per robot, float64; only once a robot has told one
MOVABLE = ("movable_x_m", "movable_y_m", "movable_heading_rad")  # lists with a number per movable obstacle, if any
RADIO = ("sent", "received", "in_range")  # packets; receivers; receivers: since the tick before
KEYS = ("tick", "time_s", "arena", "seed")
BYTES_PER_ROBOT = 4 * len(MOTION) + 1 + 4


def robot_columns(static: Static) -> tuple[str, ...]:
    """The columns that are lists with an item per robot."""
    sideways = any(isinstance(group.body.drive, Holonomic) for group in static.groups)
    return (*ROBOT_COLUMNS, SIDEWAYS) if sideways else ROBOT_COLUMNS


def movable_columns(static: Static) -> tuple[str, ...]:
    """The columns that are lists with an item per movable obstacle."""
    return MOVABLE if static.movable else ()


def tick_schema(static: Static, metrics: Sequence[str], *, with_value: bool = False) -> "dict[str, Any]":
    """The type of each column, for a run of these robots and movable obstacles with these metrics."""
    import polars as pl

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

    def frame(self) -> "pl.DataFrame":
        """The rows filled so far, by tick and arena."""
        import polars as pl

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
