"""A probe of a radio's coverage as people read it in a terminal, and as programs do."""

from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.radio.analysis.coverage import Band
from swarmwire.deploy.radio.coverage_probe import CoverageProbe

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
