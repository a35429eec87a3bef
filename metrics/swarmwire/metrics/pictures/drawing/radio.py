"""Pictures of a radio: the PDR of a run over distance, and the coverage of a scenario's radio."""

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.observe.truth import Static
from swarmwire.comms.radio.analysis.coverage import Band, ByDistance, CoverageMap
from swarmwire.metrics.pictures.drawing.canvas import (
    CURVE,
    FAINT,
    FLOOR,
    INK,
    LINK,
    LONG_SIDE_IN,
    PAPER,
    SMALL_PT,
    SOFT,
    TEXT_PT,
    TITLE_PT,
    Look,
    new_figure,
    plain_axes,
    save,
)
from swarmwire.metrics.pictures.drawing.scene import draw_scenery
from swarmwire.metrics.records.run_folder.reader import RunFolder
from swarmwire.metrics.statistics.bootstrap import binomial_interval

_MAX_DISTANCE = 1.5  # greatest distance of the picture, relative to that of the farthest reception
_DELIVERY_HEIGHT_IN = 3.9
_COVERAGE_HEIGHT_IN, _EDGE_IN = 3.75, 0.3
_MAP_IN = 2.55  # longer side of the arena
_MAP_TOP_IN = 0.64  # distance below the upper edge
_COLORS, _DISK_COLOR = "viridis", 0.55
_SCALE_TICKS = 5
_MAP_OPACITY = 0.6  # obstacles stay visible
_TITLE: Look = {"loc": "left", "fontsize": TEXT_PT, "color": SOFT, "pad": 4}
_LEGEND: Look = {"fontsize": SMALL_PT, "frameon": False, "labelcolor": SOFT, "loc": "best"}


def received_bins(table: pl.DataFrame) -> pl.DataFrame:
    """Return the bins of `radio_distances` up to 1.5 times the distance of the farthest reception."""
    received = table.filter(pl.col("received") > 0)["to_m"]
    return table.filter(pl.col("from_m") < _MAX_DISTANCE * float(received[-1])) if len(received) else table


def draw_ratio(axes: Any, table: pl.DataFrame, range_m: float | None) -> None:
    """Draw the ratio of each bin with its binomial 95 % interval, and the nominal range, if any."""
    pdr = table["pdr"].cast(float).fill_null(np.nan).to_numpy()
    edges_m = _edges_m(table)
    middle_m = 0.5 * (edges_m[:-1] + edges_m[1:])
    axes.plot(middle_m, pdr, color=CURVE, lw=1.4, marker="o", ms=3)
    measured = np.isfinite(pdr)
    low, high = binomial_interval(table["received"].to_numpy()[measured], table["intended"].to_numpy()[measured])
    axes.vlines(middle_m[measured], low, high, color=CURVE, lw=2.6, alpha=0.35)
    axes.set_xlim(0.0, float(edges_m[-1]))
    axes.set_ylim(-0.03, 1.05)
    if not measured.any():
        style: Look = {"transform": axes.transAxes, "ha": "center", "va": "center", "fontsize": TEXT_PT, "color": SOFT}
        axes.text(0.5, 0.5, "packets were on their way for too long:\nthe distance is not measured", **style)
    if range_m is not None and range_m < edges_m[-1]:
        axes.axvline(range_m, color=SOFT, lw=0.7, alpha=0.7, ls="--")
        look: Look = {"xycoords": ("data", "axes fraction"), "textcoords": "offset points"}
        axes.annotate("range", (range_m, 1.0), (3, -7), fontsize=SMALL_PT, color=SOFT, **look)


def draw_intended(axes: Any, table: pl.DataFrame) -> None:
    """Draw the number of intended receivers of packets on air in each bin."""
    edges_m = _edges_m(table)
    axes.stairs(table["intended"].to_numpy(), edges_m, fill=True, color=LINK, alpha=0.6)
    axes.locator_params(axis="y", nbins=3)
    axes.set_xlim(0.0, float(edges_m[-1]))
    axes.set_xlabel("distance between sender and receiver in m", fontsize=SMALL_PT, color=SOFT, labelpad=2)


def _edges_m(table: pl.DataFrame) -> FloatArray:
    return np.append(table["from_m"].to_numpy(), table["to_m"][-1])


def draw_distances(run: RunFolder, arena: int, to: Path, size_px: int) -> None:
    """Write the picture of an arena. BadInput for a wrong path, size or arena, or a run without the table."""
    static = run.static
    if not 0 <= arena < static.arenas:
        raise BadInput("--arena", "", f"expected 0 to {static.arenas - 1}, got {arena}")
    table = received_bins(run.validated("radio_distances", arena))
    if not len(table):
        raise BadInput("--kind", "delivery", "expected a run in which packets had intended receivers")
    figure = new_figure(LONG_SIDE_IN, _DELIVERY_HEIGHT_IN, size_px)
    title = static.name if static.arenas == 1 else f"{static.name}, seed {static.seeds[arena]}"
    figure.text(0.025, 0.945, title, fontsize=TITLE_PT, fontweight="bold", color=INK)
    upper = plain_axes(figure, (0.085, 0.45, 0.885, 0.4), "share of the receivers that received, with 95 % intervals")
    lower = plain_axes(figure, (0.085, 0.13, 0.885, 0.2), "receivers that packets on air were meant for")
    draw_ratio(upper, table, static.range_m)
    draw_intended(lower, table)
    save(figure, to)


def draw_coverage(
    static: Static,
    coverage: CoverageMap,
    distances: ByDistance,
    sensitivity_dbm: float | None,
    title: str,
    to: Path,
) -> None:
    """Write the picture of the first arena. BadInput for a path that cannot be written."""
    figure = new_figure(LONG_SIDE_IN, _COVERAGE_HEIGHT_IN)
    figure.text(0.025, 0.94, title, fontsize=TITLE_PT, fontweight="bold", color=INK)
    _draw_map(figure, static, coverage, sensitivity_dbm)
    has_strength = distances.mean_dbm is not None
    box = (0.55, 0.57, 0.425, 0.26) if has_strength else (0.55, 0.36, 0.425, 0.47)
    delivery = _axes(figure, box, "delivery of lone packets over distance in m")
    _draw_band(delivery, distances, distances.delivery)
    delivery.set_ylim(-0.03, 1.03)
    legend_axes = delivery
    if distances.mean_dbm is not None:
        legend_axes = strength = _axes(figure, (0.55, 0.115, 0.425, 0.3), "mean strength in dBm over distance in m")
        _draw_band(strength, distances, distances.mean_dbm)
        if sensitivity_dbm is not None:
            strength.axhline(sensitivity_dbm, color=SOFT, lw=0.9, ls=(0, (4, 3)), label="sensitivity")
    delivery.legend(*legend_axes.get_legend_handles_labels(), **_LEGEND)
    save(figure, to)


def _draw_map(figure: Any, static: Static, coverage: CoverageMap, sensitivity_dbm: float | None) -> None:
    """Draw the strength above the sensitivity, or the area of a unit disk; positions out of range stay bare."""
    width_m, height_m = static.arena_size_m
    per_m = _MAP_IN / max(width_m, height_m)
    width, height = width_m * per_m / LONG_SIDE_IN, height_m * per_m / _COVERAGE_HEIGHT_IN
    bottom = 1.0 - _MAP_TOP_IN / _COVERAGE_HEIGHT_IN - height
    axes = figure.add_axes((_EDGE_IN / LONG_SIDE_IN, bottom, width, height))
    axes.set(xlim=(-0.5 * width_m, 0.5 * width_m), ylim=(-0.5 * height_m, 0.5 * height_m))
    axes.tick_params(labelsize=SMALL_PT, colors=SOFT, color=FAINT, length=2.5, width=0.7, pad=2)
    axes.spines[:].set_visible(False)
    for axis, side_m in ((axes.xaxis, width_m), (axes.yaxis, height_m)):
        axis.get_major_locator().set_params(
            nbins=max(2, round(6 * side_m / max(width_m, height_m))), steps=[1, 2, 5, 10]
        )
    draw_scenery(axes, static, 0)
    image: Look = {
        "extent": (-0.5 * width_m, 0.5 * width_m, -0.5 * height_m, 0.5 * height_m),
        "origin": "lower",
        "alpha": _MAP_OPACITY,
        "zorder": 0.5,
    }
    sender = f"from ({coverage.at_m[0]:.2f}, {coverage.at_m[1]:.2f})"
    axes.plot(*coverage.at_m, "o", ms=5.0, mfc=PAPER, mec=INK, mew=1.1, zorder=3)
    if coverage.mean_dbm is None:
        axes.set_title(f"in reach {sender}", **_TITLE)
        reached = np.ma.masked_where(~coverage.in_range, np.full(coverage.in_range.shape, _DISK_COLOR))
        axes.imshow(reached, vmin=0.0, vmax=1.0, cmap="Blues", interpolation="nearest", **image)
        return
    axes.set_title(f"mean strength in dBm {sender}", **_TITLE)
    reached = np.ma.masked_where(~coverage.in_range, coverage.mean_dbm)
    shown = axes.imshow(reached, vmin=sensitivity_dbm, cmap=_COLORS, interpolation="nearest", **image)
    _add_scale(figure, shown, bottom, width)


def _add_scale(figure: Any, shown: Any, bottom: float, width: float) -> None:
    from matplotlib.ticker import MaxNLocator

    bar_axes = figure.add_axes(
        (_EDGE_IN / LONG_SIDE_IN, bottom - 0.33 / _COVERAGE_HEIGHT_IN, width, 0.07 / _COVERAGE_HEIGHT_IN)
    )
    bar = figure.colorbar(shown, cax=bar_axes, orientation="horizontal", ticks=MaxNLocator(_SCALE_TICKS))
    bar.outline.set_visible(False)
    bar.ax.tick_params(labelsize=SMALL_PT, colors=SOFT, length=0, pad=2)


def _axes(figure: Any, box: tuple[float, float, float, float], title: str) -> Any:
    axes = plain_axes(figure, box, title)
    axes.set_facecolor(FLOOR)
    axes.spines[:].set_visible(False)
    return axes


def _draw_band(axes: Any, distances: ByDistance, band: Band) -> None:
    shade: Look = {"color": CURVE, "alpha": 0.18, "lw": 0, "label": "5 to 95 % of links"}
    axes.fill_between(distances.distance_m, band.low, band.high, **shade)
    axes.plot(distances.distance_m, band.mean, color=CURVE, lw=1.4, label="mean")
    axes.set_xlim(0.0, None)
