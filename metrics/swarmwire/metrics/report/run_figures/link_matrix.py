"""The delivery ratio of each link, a square for each sender and receiver."""

from typing import Any

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.truth import Static
from swarmwire.metrics.drawing.looks import FLOOR, PAPER, SMALL_PT, SOFT
from swarmwire.metrics.report.svg import COLUMN_IN, blank_figure

MOST_NAMED = 14  # robots, of which each has its name beside the matrix
_LEFT_IN, _RIGHT_IN, _TOP_IN, _FOOT_IN, _BAR_IN = 0.62, 0.1, 0.26, 0.72, 0.07


def link_matrix(static: Static, pdr: FloatArray) -> Any:
    """The figure of ratios (n, n), a row for each sender; NaN: never in range, or the robot itself."""
    side_in = COLUMN_IN - _LEFT_IN - _RIGHT_IN
    height_in = _TOP_IN + side_in + _FOOT_IN
    figure = blank_figure(COLUMN_IN, height_in)
    axes = figure.add_axes((_LEFT_IN / COLUMN_IN, _FOOT_IN / height_in, side_in / COLUMN_IN, side_in / height_in))
    shown = axes.imshow(np.ma.masked_invalid(pdr), cmap="cividis", vmin=0.0, vmax=1.0, interpolation="none")
    axes.set_facecolor(FLOOR)
    axes.spines[:].set_visible(False)
    axes.tick_params(labelsize=SMALL_PT, colors=SOFT, length=0, pad=2)
    _name(axes, static)
    for group in static.groups[1:]:
        for line in (axes.axhline, axes.axvline):
            line(group.start - 0.5, color=PAPER, lw=1.2)
    axes.set_title("share heard, by sender (rows) and receiver", loc="left", fontsize=SMALL_PT + 1, color=SOFT, pad=4)
    below = figure.add_axes(((COLUMN_IN - 1.7) / COLUMN_IN, 0.26 / height_in, 1.5 / COLUMN_IN, _BAR_IN / height_in))
    bar = figure.colorbar(shown, cax=below, orientation="horizontal", ticks=[0.0, 0.5, 1.0])
    bar.outline.set_visible(False)
    below.tick_params(labelsize=SMALL_PT, colors=SOFT, length=0, pad=2)
    said = {"fontsize": SMALL_PT, "color": SOFT, "va": "center"}
    figure.text((COLUMN_IN - 1.8) / COLUMN_IN, 0.295 / height_in, "pale grey: never in range", ha="right", **said)
    return figure


def _name(axes: Any, static: Static) -> None:
    """Robots by name, or if they are many groups by theirs, at their middle."""
    if static.robots <= MOST_NAMED:
        places, names = list(range(static.robots)), list(static.robot_names)
    else:
        places = [0.5 * (group.start + group.stop - 1) for group in static.groups]
        names = [group.name for group in static.groups]
    longest = max(map(len, names))
    axes.set_yticks(places, names)
    axes.set_xticks(places, names, rotation=0 if len(names) * longest < 40 else 90)
    if longest > 10:
        axes.tick_params(labelsize=SMALL_PT - 1.5)
