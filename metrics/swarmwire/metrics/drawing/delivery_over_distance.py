"""The delivery ratio over distance on axes, and over how many receivers it was taken."""

from typing import TYPE_CHECKING, Any

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.metrics.drawing.looks import CURVE, LINK, SMALL_PT, SOFT, TEXT_PT, Look
from swarmwire.metrics.statistics.bootstrap import binomial_interval

if TYPE_CHECKING:
    import polars as pl

_BEYOND = 1.5  # of the distance at which the last packet was received: how far the picture goes


def received_bins(table: "pl.DataFrame") -> "pl.DataFrame":
    """The bins of `radio_distances` up to somewhat beyond the last in which anybody received."""
    import polars as pl

    received = table.filter(pl.col("received") > 0)["to_m"]
    return table.filter(pl.col("from_m") < _BEYOND * float(received[-1])) if len(received) else table


def draw_ratio(axes: Any, table: "pl.DataFrame", range_m: float | None) -> None:
    """The ratio of each bin with its binomial 95 % interval, and the nominal range if it has one."""
    pdr = table["pdr"].cast(float).fill_null(np.nan).to_numpy()
    edges_m = _edges_m(table)
    middle_m = 0.5 * (edges_m[:-1] + edges_m[1:])
    axes.plot(middle_m, pdr, color=CURVE, lw=1.4, marker="o", ms=3)
    known = np.isfinite(pdr)
    low, high = binomial_interval(table["received"].to_numpy()[known], table["intended"].to_numpy()[known])
    axes.vlines(middle_m[known], low, high, color=CURVE, lw=2.6, alpha=0.35)
    axes.set_xlim(0.0, float(edges_m[-1]))
    axes.set_ylim(-0.03, 1.05)
    if not known.any():
        said: Look = {"transform": axes.transAxes, "ha": "center", "va": "center", "fontsize": TEXT_PT, "color": SOFT}
        axes.text(0.5, 0.5, "packets were on their way for too long:\nthe distance is not known", **said)
    if range_m is not None and range_m < edges_m[-1]:
        axes.axvline(range_m, color=SOFT, lw=0.7, alpha=0.7, ls="--")
        at: Look = {"xycoords": ("data", "axes fraction"), "textcoords": "offset points"}
        axes.annotate("range", (range_m, 1.0), (3, -7), fontsize=SMALL_PT, color=SOFT, **at)


def draw_intended(axes: Any, table: "pl.DataFrame") -> None:
    """How many receivers packets on air were meant for in each bin."""
    edges_m = _edges_m(table)
    axes.stairs(table["intended"].to_numpy(), edges_m, fill=True, color=LINK, alpha=0.6)
    axes.locator_params(axis="y", nbins=3)
    axes.set_xlim(0.0, float(edges_m[-1]))
    axes.set_xlabel("distance between sender and receiver in m", fontsize=SMALL_PT, color=SOFT, labelpad=2)


def _edges_m(table: "pl.DataFrame") -> FloatArray:
    return np.append(table["from_m"].to_numpy(), table["to_m"][-1])
