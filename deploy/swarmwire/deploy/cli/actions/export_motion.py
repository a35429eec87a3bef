"""The motion of a run's robots as a trace, which swarmwire and other simulators can follow."""

from pathlib import Path

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.atomic import check_output_path, output_file
from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy.cli.actions.export_metrics_table import chosen_ticks
from swarmwire.deploy.cli.exporters import EEL, MOTION, ExportOptions
from swarmwire.metrics.records.run_folder.layout import HEIGHT, MOVABLE, POSE, VALUE
from swarmwire.metrics.records.run_folder.reader import RunFolder
from swarmwire.metrics.records.run_folder.ticks import robot_columns
from swarmwire.world.motion.traces.reading import write_trace
from swarmwire.world.motion.traces.trace import MotionTrace, trace_of_columns

CORNER_SUFFIXES = (".movements", ".tcl")  # their origin is the lower left corner, that of an arena its centre
DECIMALS = 6  # poses are recorded with 24 bits: more digits are noise


def write_motion(run: Path, to: Path, options: ExportOptions) -> str:
    """Write a sample per robot and tick of an arena from `from_s` to `until_s`."""
    check_output_path(to, MOTION.suffixes + EEL.suffixes)
    origin = _parse_origin(options.origin or "0,0,0")
    trace, size_m = _recorded_motion(RunFolder(run), options)
    if to.suffix.lower() in CORNER_SUFFIXES:
        trace = trace.shifted(size_m[0] / 2.0, size_m[1] / 2.0)
    with output_file(to) as part:
        write_trace(part, trace, origin=origin)
    robots = len(trace.names)
    return f"{robots} robots, {len(trace.t_s) // robots} samples each"


def _recorded_motion(folder: RunFolder, options: ExportOptions) -> tuple[MotionTrace, tuple[float, float]]:
    """Return the trace of an arena, and the arena's size in m."""
    static, arena = folder.static, options.arena or 0
    if not 0 <= arena < static.arenas:
        raise BadInput("--arena", "", f"expected 0 to {static.arenas - 1}, got {arena}")
    unused = [name for name in (*robot_columns(static), VALUE, *MOVABLE) if name not in (*POSE, HEIGHT)]
    ticks = folder.table("ticks", arena, unused).sort("tick")
    if ticks.is_empty():
        raise BadInput(str(folder.path), "", "holds no tick yet")
    chosen = chosen_ticks(ticks["time_s"].to_numpy(), options)
    t_s = ticks["time_s"].to_numpy()[chosen]

    def by_robot(column: str) -> FloatArray:
        values = ticks[column].to_numpy()[chosen].astype(np.float64)
        return np.round(values, DECIMALS).T.reshape(-1)

    x_m, y_m, heading_rad = map(by_robot, POSE)
    if HEIGHT in ticks.columns:
        z_m = by_robot(HEIGHT)
    else:
        altitudes_m = [group.body.altitude_m for group in static.groups for _ in range(group.start, group.stop)]
        z_m = np.repeat(altitudes_m, len(t_s))
    first = len(t_s) * np.arange(static.robots + 1)
    trace = trace_of_columns(static.robot_names, first, np.tile(t_s, static.robots), x_m, y_m, z_m, heading_rad)
    return trace, static.arena_size_m


def _parse_origin(text: str) -> tuple[float, float, float]:
    """Return latitude and longitude in degrees and height in m."""
    try:
        latitude, longitude, height_m = map(float, text.split(","))
    except ValueError:
        latitude = longitude = height_m = np.nan
    if not (abs(latitude) <= 90.0 and abs(longitude) <= 360.0 and abs(height_m) <= 1e6):
        expected = "expected LAT,LON,ALT: latitude from -90 to 90 and longitude in degrees, height in m"
        raise BadInput("--origin", "", f"{expected}; got {text}")
    return latitude, longitude, height_m
