"""A scenario's radio without its swarm: what it covers from one place, and what gets through over which distance."""

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
from swarmwire.comms.radio.config.phy import Antennas
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.deploy.runs.config import RunConfig
from swarmwire.deploy.runs.plan import make_plan
from swarmwire.world.scenario.scenario import Scenario

DISTANCES = 48
BEYOND_RANGE = 1.5  # distances reach that far beyond the nominal range, if the arena does


@dataclass(frozen=True, eq=False)
class CoverageProbe:
    """What was found in the first arena."""

    static: Static
    payload_bytes: int
    sensitivity_dbm: float | None  # None for a disk
    map: CoverageMap
    distances: ByDistance


def probe_coverage(
    scenario: Path,
    *,
    seed: int | None = None,
    overrides: Sequence[str] = (),
    at_m: tuple[float, float] | None = None,
    robot: str | None = None,
    payload_bytes: int | None = None,
    points: int = 200,
) -> CoverageProbe:
    """Probe from a place, or from where this robot starts, the first one if neither is given.

    Packets have as many bytes as the radio takes, unless it is said; the map has so many `points` along the longer side
    of the arena. BadInput for a scenario without a radio, or whose links are measured alone, and for places and robots
    that are not there.
    """
    plan, world = make_plan(RunConfig(scenario, seed=seed, overrides=overrides))
    static, radio, where = plan.static, plan.scenario.radio, str(scenario)
    if radio is None:
        raise BadInput(where, "radio", "is missing; expected a scenario with a radio")
    if radio.trace is not None and radio.trace.others == "none":
        raise BadInput(where, "radio.trace.others", 'expected "model": links are measured between robots, not places')
    size_m = static.arena_size_m
    place = world.pose[_index(static, robot)]
    from_m = (float(place[0]), float(place[1])) if at_m is None else at_m
    if at_m is not None and not all(abs(x) <= 0.5 * side for x, side in zip(at_m, size_m, strict=True)):
        raise BadInput("--at", "", f"expected a place in the arena of {size_m[0]:g} x {size_m[1]:g} m around 0,0")
    most = radio.max_payload_bytes
    if payload_bytes is not None and not 0 <= payload_bytes <= most:
        raise BadInput("--bytes", "", f"expected 0 to {most}, which the radio takes; got {payload_bytes}")
    payload_bytes = most if payload_bytes is None else payload_bytes
    key = world.keys[0]
    if at_m is None:
        radio = _as_sent_by(radio, plan.scenario, _index(static, robot))
    coverage = RadioCoverage(
        radio, key, ObstacleIndices(obstacle_arrays(static.obstacles[:1]), size_m, 0.0), payload_bytes
    )
    farthest_m = min(math.hypot(*size_m), BEYOND_RANGE * (static.range_m or math.inf))
    return CoverageProbe(
        static=static,
        payload_bytes=payload_bytes,
        sensitivity_dbm=coverage.sensitivity_dbm,
        map=coverage_map(coverage, size_m, from_m, points),
        distances=by_distance(coverage, size_m, key, farthest_m, DISTANCES),
    )


def _as_sent_by(radio: Radio, scenario: Scenario, index: int) -> Radio:
    """The radio with the power and gain of a robot's group as that of the sender."""
    if not radio.is_phy:
        return radio
    antennas = Antennas.of_groups((table.count, table.radio) for table in scenario.robots.values())
    antenna = radio.antenna_or_default
    power_dbm = float(antennas.send_dbm(antenna)[index]) - antenna.gain_dbi
    return replace(radio, antenna=replace(antenna, power_dbm=power_dbm))


def _index(static: Static, robot: str | None) -> int:
    if robot is None:
        return 0
    if robot not in static.robot_names:
        first, last = static.robot_names[0], static.robot_names[-1]
        raise BadInput("--from", "", f"expected a robot of the scenario, {first} … {last}, got {robot}")
    return static.robot_names.index(robot)


ROWS = 16  # of the table over distance
GOOD = 0.9  # delivery
DIGITS_DBM, DIGITS = 2, 4


def print_coverage(probe: CoverageProbe, console: Console) -> None:
    """The shares of the arena that are covered, then delivery and strength over distance."""
    found, static = probe.map, probe.static
    reach = "" if static.range_m is None else f", nominal range {static.range_m:.3g} m"
    floor = "" if probe.sensitivity_dbm is None else f", sensitivity {probe.sensitivity_dbm:.1f} dBm"
    head = f"{static.name}: packets of {probe.payload_bytes} bytes{reach}{floor}"
    console.print(head, soft_wrap=True)
    x_m, y_m = found.at_m
    in_range, good = found.share(found.in_range), found.share(found.delivery >= GOOD)
    text = f"{in_range:.1%} of the arena in range, {good:.1%} with a delivery of {GOOD} or more"
    console.print(f"from ({x_m:.2f}, {y_m:.2f}): {text}", soft_wrap=True)
    table = Table(title=Text("by distance, with quantiles of links"), title_justify="left", title_style="bold")
    for name in ("distance, m", "delivery", "5 %", "95 %"):
        table.add_column(name, justify="right")
    if probe.distances.mean_dbm is not None:
        for name in ("strength, dBm", "5 %", "95 %"):
            table.add_column(name, justify="right")
    distance_m = probe.distances.distance_m
    for i in np.unique(np.round(np.linspace(0, len(distance_m) - 1, min(ROWS, len(distance_m)))).astype(int)):
        cells = [f"{distance_m[i]:.2f}", *_cells(probe.distances.delivery, int(i), 3)]
        if probe.distances.mean_dbm is not None:
            cells += _cells(probe.distances.mean_dbm, int(i), 1)
        table.add_row(*cells)
    console.print(table)


def coverage_json(probe: CoverageProbe) -> dict[str, Any]:
    """All of it, as JSON takes it; rows of the map from the lowest y up."""
    found, distances = probe.map, probe.distances
    return {
        "scenario": probe.static.name,
        "seed": probe.static.seeds[0],
        "payload_bytes": probe.payload_bytes,
        "range_m": probe.static.range_m,
        "sensitivity_dbm": probe.sensitivity_dbm,
        "in_range_share": found.share(found.in_range),
        "map": {
            "at_m": found.at_m,
            "x_m": _rounded(found.x_m, DIGITS),
            "y_m": _rounded(found.y_m, DIGITS),
            "in_range": found.in_range.tolist(),
            "delivery": _rounded(found.delivery, DIGITS),
            "mean_dbm": None if found.mean_dbm is None else _rounded(found.mean_dbm, DIGITS_DBM),
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
