"""The delivery ratio over distance as a picture, and below it over how many receivers it was taken."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.errors import BadInput
from swarmwire.metrics.drawing.canvas import new_figure, save
from swarmwire.metrics.drawing.looks import (
    CURVE,
    INK,
    LINK,
    LONG_SIDE_IN,
    SMALL_PT,
    SOFT,
    TEXT_PT,
    TITLE_PT,
    Look,
)
from swarmwire.metrics.drawing.plain_axes import plain_axes
from swarmwire.metrics.run_folder import RunFolder
from swarmwire.metrics.verify.sound_table import sound_table

if TYPE_CHECKING:
    import polars as pl

_HEIGHT_IN = 3.9
_BEYOND = 1.5  # of the distance at which the last packet was heard: how far the picture goes


def draw_distances(run: RunFolder, arena: int, to: Path, size_px: int) -> None:
    """Write the picture of one arena. BadInput for a path, size or arena that cannot be, or a run without the table."""
    static = run.static
    if not 0 <= arena < static.arenas:
        raise BadInput("--arena", "", f"expected 0 to {static.arenas - 1}, got {arena}")
    table = _shown(sound_table(run, "radio_distances", run.radio_distances(arena)))
    figure = new_figure(LONG_SIDE_IN, _HEIGHT_IN, size_px)
    title = static.name if static.arenas == 1 else f"{static.name}, seed {static.seeds[arena]}"
    figure.text(0.025, 0.945, title, fontsize=TITLE_PT, fontweight="bold", color=INK)
    upper = plain_axes(figure, (0.085, 0.45, 0.885, 0.4), "share of the receivers that heard")
    lower = plain_axes(figure, (0.085, 0.13, 0.885, 0.2), "receivers that packets on air were meant for")
    edges_m = np.append(table["from_m"].to_numpy(), table["to_m"][-1])
    _draw_ratio(upper, edges_m, table["pdr"].cast(float).to_numpy(), static.range_m)
    lower.stairs(table["intended"].to_numpy(), edges_m, fill=True, color=LINK, alpha=0.6)
    lower.locator_params(axis="y", nbins=3)
    lower.set_xlabel("distance between sender and receiver in m", fontsize=SMALL_PT, color=SOFT, labelpad=2)
    for axes in (upper, lower):
        axes.set_xlim(0.0, float(edges_m[-1]))
    save(figure, to)


def _shown(table: "pl.DataFrame") -> "pl.DataFrame":
    """The bins up to somewhat beyond the last in which anybody heard."""
    import polars as pl

    if not len(table):
        raise BadInput("--pdr", "", "expected a run in which packets went on air")
    heard = table.filter(pl.col("heard") > 0)["to_m"]
    if not len(heard):
        return table
    return table.filter(pl.col("from_m") < _BEYOND * float(heard[-1]))


def _draw_ratio(axes: Any, edges_m: FloatArray, pdr: FloatArray, range_m: float | None) -> None:
    middle_m = 0.5 * (edges_m[:-1] + edges_m[1:])
    axes.plot(middle_m, pdr, color=CURVE, lw=1.4, marker="o", ms=3)
    axes.set_ylim(-0.03, 1.05)
    if np.isnan(pdr).all():
        said: Look = {"transform": axes.transAxes, "ha": "center", "va": "center", "fontsize": TEXT_PT, "color": SOFT}
        axes.text(0.5, 0.5, "packets were on their way for too long: the distance is not known", **said)
    if range_m is not None and range_m < edges_m[-1]:
        axes.axvline(range_m, color=SOFT, lw=0.7, alpha=0.7, ls="--")
        at: Look = {"xycoords": ("data", "axes fraction"), "textcoords": "offset points"}
        axes.annotate("range", (range_m, 1.0), (3, -7), fontsize=SMALL_PT, color=SOFT, **at)
