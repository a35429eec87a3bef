"""Run folders of swarmwire as traces: the recorded poses of the robots of the first arena, bit for bit.

`static.json` has the rate and the robots' names, `ticks.parquet` a row per tick with a number per robot in each column;
a killed run has its parts in `ticks/`. Heights that are not recorded are those of the bodies.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.config import read_json
from swarmwire.comms.base.errors import BadInput
from swarmwire.world.motion.traces.table import refuse_damage
from swarmwire.world.motion.traces.trace import MotionTrace, trace_of_columns

STATIC = "static.json"
STATIC_FORMAT = 1
HEIGHT = "z_m"
COLUMNS = ("x_m", "y_m", "heading_rad", HEIGHT)


@dataclass(frozen=True)
class RecordedBody:
    """A body, as `static.json` describes it."""

    altitude_m: float


@dataclass(frozen=True)
class RecordedGroup:
    """A group, as `static.json` describes it."""

    start: int
    stop: int
    body: RecordedBody


@dataclass(frozen=True)
class RecordedStatic:
    """The keys of `static.json` that a trace needs."""

    rate_hz: int
    robot_names: tuple[str, ...]
    groups: tuple[RecordedGroup, ...]


def files(folder: Path) -> list[Path]:
    """Return the files of the folder that a trace needs; BadInput if no motion was recorded."""
    table = folder / "ticks.parquet"
    tables = [table] if table.is_file() else sorted((folder / "ticks").glob("part-*.parquet"))
    if not tables:
        raise BadInput(str(folder), "", "expected a run that recorded its motion: there is no ticks.parquet")
    return [folder / STATIC, *tables]


def read(folder: Path) -> MotionTrace:
    """Read the robots in the order of the run."""
    import polars as pl

    _, *tables = files(folder)
    static = read_json(RecordedStatic, folder / STATIC, STATIC_FORMAT)
    robots = len(static.robot_names)
    with refuse_damage(folder):
        scan = pl.scan_parquet(tables)
        recorded = [column for column in COLUMNS if column != HEIGHT or HEIGHT in scan.collect_schema()]
        numbers = pl.col(recorded).cast(pl.Array(pl.Float64, robots))
        frame = scan.filter(pl.col("arena") == 0).sort("tick").select("tick", numbers).collect()
    if frame.is_empty() or not robots:
        raise BadInput(str(folder), "", "expected a run of at least one robot and one tick")

    def by_robot(column: str) -> FloatArray:
        values: FloatArray = frame[column].to_numpy().T.reshape(-1)
        if not np.isfinite(values).all():
            raise BadInput(str(folder), column, "expected finite numbers")
        return values

    x_m, y_m, heading_rad, *recorded_z_m = map(by_robot, recorded)
    altitudes_m = [group.body.altitude_m for group in static.groups for _ in range(group.start, group.stop)]
    (z_m,) = recorded_z_m or (np.repeat(altitudes_m, len(frame)),)
    t_s = frame["tick"].to_numpy() / static.rate_hz  # as the ends of ticks; `time_s` is rounded to ns
    first = len(frame) * np.arange(robots + 1)
    return trace_of_columns(static.robot_names, first, np.tile(t_s, robots), x_m, y_m, z_m, heading_rad)
