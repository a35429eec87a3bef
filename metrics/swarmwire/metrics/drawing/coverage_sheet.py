"""A radio's coverage on one sheet: an arena with the strength from one place; delivery and strength by distance."""

from pathlib import Path
from typing import Any

import numpy as np

from swarmwire.comms.radio.analysis.coverage import Band, ByDistance, CoverageMap
from swarmwire.comms.truth import Static
from swarmwire.metrics.drawing.canvas import new_figure, save
from swarmwire.metrics.drawing.looks import (
    CURVE,
    FAINT,
    FLOOR,
    GRID,
    INK,
    LONG_SIDE_IN,
    PAPER,
    SMALL_PT,
    SOFT,
    TEXT_PT,
    TITLE_PT,
    Look,
)
from swarmwire.metrics.drawing.scenery import draw_scenery

_HEIGHT_IN, _EDGE_IN = 3.75, 0.3
_MAP_IN = 2.55  # longer side of the arena
_MAP_TOP_IN = 0.64  # below the upper edge
_COLORS, _OF_DISK = "viridis", 0.55
_SCALE_TICKS = 5
_STRENGTH_ABOVE = 0.6  # opacity of the map, so that it does not shout down what stands on it


def draw_coverage(
    static: Static,
    found: CoverageMap,
    distances: ByDistance,
    sensitivity_dbm: float | None,
    title: str,
    to: Path,
    size_px: int,
) -> None:
    """Write the picture of the first arena. BadInput for a path or a size that cannot be."""
    figure = new_figure(LONG_SIDE_IN, _HEIGHT_IN, size_px)
    figure.text(0.025, 0.94, title, fontsize=TITLE_PT, fontweight="bold", color=INK)
    _draw_map(figure, static, found, sensitivity_dbm)
    has_strength = distances.mean_dbm is not None
    delivery = _axes(figure, (0.55, 0.57 if has_strength else 0.36, 0.425, 0.26 if has_strength else 0.47))
    delivery.set_title("delivery of lone packets over distance in m", **_TITLE)
    _draw_band(delivery, distances, distances.delivery)
    delivery.set_ylim(-0.03, 1.03)
    explained = delivery
    if distances.mean_dbm is not None:
        explained = strength = _axes(figure, (0.55, 0.115, 0.425, 0.3))
        strength.set_title("mean strength in dBm over distance in m", **_TITLE)
        _draw_band(strength, distances, distances.mean_dbm)
        if sensitivity_dbm is not None:
            strength.axhline(sensitivity_dbm, color=SOFT, lw=0.9, ls=(0, (4, 3)), label="sensitivity")
    delivery.legend(*explained.get_legend_handles_labels(), **_LEGEND)  # where curves leave room
    save(figure, to)


_TITLE: Look = {"loc": "left", "fontsize": TEXT_PT, "color": SOFT, "pad": 4}
_LEGEND: Look = {"fontsize": SMALL_PT, "frameon": False, "labelcolor": SOFT, "loc": "best"}


def _draw_map(figure: Any, static: Static, found: CoverageMap, sensitivity_dbm: float | None) -> None:
    """Strength above the sensitivity, or what a disk reaches; what is out of range stays bare."""
    across_m, up_m = static.arena_size_m
    per_m = _MAP_IN / max(across_m, up_m)
    width, height = across_m * per_m / LONG_SIDE_IN, up_m * per_m / _HEIGHT_IN
    bottom = 1.0 - _MAP_TOP_IN / _HEIGHT_IN - height
    axes = figure.add_axes((_EDGE_IN / LONG_SIDE_IN, bottom, width, height))
    axes.set(xlim=(-0.5 * across_m, 0.5 * across_m), ylim=(-0.5 * up_m, 0.5 * up_m))
    axes.tick_params(labelsize=SMALL_PT, colors=SOFT, color=FAINT, length=2.5, width=0.7, pad=2)
    axes.spines[:].set_visible(False)
    for axis, side_m in ((axes.xaxis, across_m), (axes.yaxis, up_m)):
        axis.get_major_locator().set_params(nbins=max(2, round(6 * side_m / max(across_m, up_m))), steps=[1, 2, 5, 10])
    draw_scenery(axes, static, 0)
    image: Look = {
        "extent": (-0.5 * across_m, 0.5 * across_m, -0.5 * up_m, 0.5 * up_m),
        "origin": "lower",
        "alpha": _STRENGTH_ABOVE,
        "zorder": 0.5,
    }
    from_where = f"from ({found.at_m[0]:.2f}, {found.at_m[1]:.2f})"
    axes.plot(*found.at_m, "o", ms=5.0, mfc=PAPER, mec=INK, mew=1.1, zorder=3)
    if found.mean_dbm is None:
        axes.set_title(f"in reach {from_where}", **_TITLE)
        reached = np.ma.masked_where(~found.in_range, np.full(found.in_range.shape, _OF_DISK))
        axes.imshow(reached, vmin=0.0, vmax=1.0, cmap="Blues", interpolation="nearest", **image)
        return
    axes.set_title(f"mean strength in dBm {from_where}", **_TITLE)
    reached = np.ma.masked_where(~found.in_range, found.mean_dbm)
    shown = axes.imshow(reached, vmin=sensitivity_dbm, cmap=_COLORS, interpolation="nearest", **image)
    _add_scale(figure, shown, bottom, width)


def _add_scale(figure: Any, shown: Any, bottom: float, width: float) -> None:
    from matplotlib.ticker import MaxNLocator

    place = figure.add_axes((_EDGE_IN / LONG_SIDE_IN, bottom - 0.33 / _HEIGHT_IN, width, 0.07 / _HEIGHT_IN))
    bar = figure.colorbar(shown, cax=place, orientation="horizontal", ticks=MaxNLocator(_SCALE_TICKS))
    bar.outline.set_visible(False)
    bar.ax.tick_params(labelsize=SMALL_PT, colors=SOFT, length=0, pad=2)


def _axes(figure: Any, place: tuple[float, float, float, float]) -> Any:
    axes = figure.add_axes(place)
    axes.set_facecolor(FLOOR)
    axes.spines[:].set_visible(False)
    axes.grid(axis="y", color=GRID, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(which="both", labelsize=SMALL_PT, colors=SOFT, length=0, pad=2)
    return axes


def _draw_band(axes: Any, distances: ByDistance, band: Band) -> None:
    shade: Look = {"color": CURVE, "alpha": 0.18, "lw": 0, "label": "5 to 95 % of links"}
    axes.fill_between(distances.distance_m, band.low, band.high, **shade)
    axes.plot(distances.distance_m, band.mean, color=CURVE, lw=1.4, label="mean")
    axes.set_xlim(0.0, None)
