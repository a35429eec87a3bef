"""Coverage of a scenario's radio from one position, and delivery over distance."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.geometry.obstacle_index import ObstacleIndices
from swarmwire.comms.base.geometry.obstacles import obstacle_arrays
from swarmwire.comms.observe.truth import Static
from swarmwire.comms.radio.analysis.coverage import (
    Band,
    ByDistance,
    CoverageMap,
    RadioCoverage,
    by_distance,
    coverage_map,
)
from swarmwire.comms.radio.config.antennas import Antenna, Antennas
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.deploy.runs.config import RunConfig
from swarmwire.deploy.runs.plan import make_plan
from swarmwire.world.scenario.scenario import Scenario

DISTANCES = 48
MAX_RANGES = 1.5  # largest distance in nominal ranges, if the arena is that large


@dataclass(frozen=True, eq=False)
class CoverageProbe:
    """Coverage and delivery in the first arena."""

    static: Static
    payload_bytes: int
    sensitivity_dbm: float | None  # None for a disk
    map: CoverageMap
    distances: ByDistance


def probe_coverage(
    scenario: Path,
    *,
    seed: int | None,
    overrides: Sequence[str],
    position_m: tuple[float, float] | None,
    robot: str | None,
    payload_bytes: int | None,
    points: int,
) -> CoverageProbe:
    """Probe from a position, or if it is None from the start of a robot with its heading; None: the first one.

    Without a payload it is the radio's largest one; the map has `points` along the longer side of the arena.
    BadInput for a scenario without a radio, or with measured links only, for a position outside the arena, and for an
    unknown robot.
    """
    plan, world = make_plan(RunConfig(scenario, seed=seed, overrides=overrides))
    static, radio, where = plan.static, plan.scenario.radio, str(scenario)
    if radio is None:
        raise BadInput(where, "radio", "is missing; expected a scenario with a radio")
    if radio.trace is not None and radio.trace.others == "none":
        raise BadInput(where, "radio.trace.others", 'expected "model": links are measured between robots, not places')
    size_m = static.arena_size_m
    start = world.pose[_index(static, robot)]
    from_m = (float(start[0]), float(start[1])) if position_m is None else position_m
    if not all(abs(x) <= 0.5 * side for x, side in zip(from_m, size_m, strict=True)):
        raise BadInput("--at", "", f"expected a place in the arena of {size_m[0]:g} x {size_m[1]:g} m around 0,0")
    most = radio.max_payload_bytes
    if payload_bytes is not None and not 0 <= payload_bytes <= most:
        raise BadInput("--bytes", "", f"expected 0 to {most}, which the radio takes; got {payload_bytes}")
    payload_bytes = most if payload_bytes is None else payload_bytes
    key = world.keys[0]
    sender = None
    if position_m is None:
        index = _index(static, robot)
        sender = _antenna_of(radio, plan.scenario, index)
        radio = _with_spreading_factor(radio, plan.scenario, index)
    obstacles = ObstacleIndices(obstacle_arrays(static.obstacles[:1]), size_m, 0.0)
    coverage = RadioCoverage(radio, key, obstacles, payload_bytes, sender)
    heading_rad = float(start[2]) if position_m is None else None
    farthest_m = min(math.hypot(*size_m), MAX_RANGES * (static.range_m or math.inf))
    return CoverageProbe(
        static=static,
        payload_bytes=payload_bytes,
        sensitivity_dbm=coverage.sensitivity_dbm,
        map=coverage_map(coverage, size_m, from_m, points, heading_rad),
        distances=by_distance(coverage, size_m, key, farthest_m, DISTANCES),
    )


def _antenna_of(radio: Radio, scenario: Scenario, index: int) -> Antenna:
    """Return the antenna of a robot."""
    antennas = Antennas.of_groups((table.count, table.radio) for table in scenario.robots.values())
    group = int(np.searchsorted(np.cumsum(antennas.counts), index, side="right"))
    return antennas.by_group(radio.antenna_or_default)[group]


def _with_spreading_factor(radio: Radio, scenario: Scenario, index: int) -> Radio:
    """Return the radio with the spreading factor of a robot, if it has one."""
    if radio.lora_or_none is None:
        return radio
    antennas = Antennas.of_groups((table.count, table.radio) for table in scenario.robots.values())
    factor = int(antennas.spreading_factors(radio.lora_or_none.spreading_factor)[index])
    return replace(radio, lora=replace(radio.lora_or_none, spreading_factor=factor))


def _index(static: Static, robot: str | None) -> int:
    if robot is None:
        return 0
    if robot not in static.robot_names:
        first, last = static.robot_names[0], static.robot_names[-1]
        raise BadInput("--from", "", f"expected a robot of the scenario, {first} … {last}, got {robot}")
    return static.robot_names.index(robot)


MAX_ROWS = 16  # rows of the table over distance
GOOD_DELIVERY = 0.9
DIGITS_DBM, DIGITS = 2, 4


def print_coverage(probe: CoverageProbe, console: Console) -> None:
    """Print the covered shares of the arena, then delivery and strength over distance."""
    coverage, static = probe.map, probe.static
    reach = "" if static.range_m is None else f", nominal range {static.range_m:.3g} m"
    floor = "" if probe.sensitivity_dbm is None else f", sensitivity {probe.sensitivity_dbm:.1f} dBm"
    head = f"{static.name}: packets of {probe.payload_bytes} bytes{reach}{floor}"
    console.print(head, soft_wrap=True)
    x_m, y_m = coverage.at_m
    in_range, good = coverage.share(coverage.in_range), coverage.share(coverage.delivery >= GOOD_DELIVERY)
    text = f"{in_range:.1%} of the arena in range, {good:.1%} with a delivery of {GOOD_DELIVERY} or more"
    console.print(f"from ({x_m:.2f}, {y_m:.2f}): {text}", soft_wrap=True)
    table = Table(title=Text("by distance, with quantiles of links"), title_justify="left", title_style="bold")
    for name in ("distance, m", "delivery", "5 %", "95 %"):
        table.add_column(name, justify="right")
    if probe.distances.mean_dbm is not None:
        for name in ("strength, dBm", "5 %", "95 %"):
            table.add_column(name, justify="right")
    distance_m = probe.distances.distance_m
    for i in np.unique(np.round(np.linspace(0, len(distance_m) - 1, min(MAX_ROWS, len(distance_m)))).astype(int)):
        cells = [f"{distance_m[i]:.2f}", *_cells(probe.distances.delivery, int(i), 3)]
        if probe.distances.mean_dbm is not None:
            cells += _cells(probe.distances.mean_dbm, int(i), 1)
        table.add_row(*cells)
    console.print(table)


def coverage_json(probe: CoverageProbe) -> dict[str, Any]:
    """Return the probe for JSON; rows of the map are in ascending order of y."""
    coverage, distances = probe.map, probe.distances
    return {
        "scenario": probe.static.name,
        "seed": probe.static.seeds[0],
        "payload_bytes": probe.payload_bytes,
        "range_m": probe.static.range_m,
        "sensitivity_dbm": probe.sensitivity_dbm,
        "in_range_share": coverage.share(coverage.in_range),
        "map": {
            "at_m": coverage.at_m,
            "x_m": _rounded(coverage.x_m, DIGITS),
            "y_m": _rounded(coverage.y_m, DIGITS),
            "in_range": coverage.in_range.tolist(),
            "delivery": _rounded(coverage.delivery, DIGITS),
            "mean_dbm": None if coverage.mean_dbm is None else _rounded(coverage.mean_dbm, DIGITS_DBM),
        },
        "by_distance": {
            "distance_m": _rounded(distances.distance_m, DIGITS),
            "delivery": _band(distances.delivery, DIGITS),
            "mean_dbm": None if distances.mean_dbm is None else _band(distances.mean_dbm, DIGITS_DBM),
        },
    }


def _cells(band: Band, i: int, digits: int) -> list[str]:
    return [f"{values[i]:.{digits}f}" for values in band]


def _band(band: Band, digits: int) -> dict[str, Any]:
    return {name: _rounded(values, digits) for name, values in band._asdict().items()}


def _rounded(values: FloatArray, digits: int) -> Any:
    return np.round(values, digits).tolist()
