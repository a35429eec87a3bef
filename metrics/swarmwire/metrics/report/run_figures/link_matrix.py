"""The delivery ratio of each link, a square for each sender and receiver."""

from typing import Any

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.truth import Static
from swarmwire.metrics.drawing.looks import FLOOR, INK, PAPER, SMALL_PT, SOFT
from swarmwire.metrics.report.in_words import shortened
from swarmwire.metrics.report.svg import COLUMN_IN, blank_figure

MAX_NAMED = 14  # robots, of which each has its name beside the matrix, and its percents in it
MAX_LETTERS = 11  # of a name
_LETTERS_ACROSS = 44
_PALE = 0.5  # ratios from which on dark letters are read better
_LEFT_IN, _RIGHT_IN, _TOP_IN, _BAR_IN = 0.62, 0.1, 0.26, 0.07
_FOOT_IN, _NAME_IN = 0.5, 0.055  # below names, and of each of their letters


def link_matrix(static: Static, link_pdr: FloatArray) -> Any:
    """The figure of ratios (n, n), a row for each sender; NaN: never in range, or the robot itself."""
    names, upright = _names(static)
    side_in = COLUMN_IN - _LEFT_IN - _RIGHT_IN
    foot_in = _FOOT_IN + (_NAME_IN * max(map(len, names.values())) if upright else 0.15)
    height_in = _TOP_IN + side_in + foot_in
    figure = blank_figure(COLUMN_IN, height_in)
    axes = figure.add_axes((_LEFT_IN / COLUMN_IN, foot_in / height_in, side_in / COLUMN_IN, side_in / height_in))
    shown = axes.imshow(np.ma.masked_invalid(link_pdr), cmap="cividis", vmin=0.0, vmax=1.0, interpolation="none")
    axes.set_facecolor(FLOOR)
    axes.spines[:].set_visible(False)
    axes.tick_params(labelsize=SMALL_PT, colors=SOFT, length=0, pad=2)
    axes.set_yticks(list(names), list(names.values()))
    axes.set_xticks(list(names), list(names.values()), rotation=90 if upright else 0)
    if static.robots <= MAX_NAMED:
        _write(axes, link_pdr)
    for group in static.groups[1:]:
        for line in (axes.axhline, axes.axvline):
            line(group.start - 0.5, color=PAPER, lw=1.2)
    axes.set_title(
        "percent received, by sender (rows) and receiver", loc="left", fontsize=SMALL_PT + 1, color=SOFT, pad=4
    )
    below = figure.add_axes(((COLUMN_IN - 1.7) / COLUMN_IN, 0.26 / height_in, 1.5 / COLUMN_IN, _BAR_IN / height_in))
    bar = figure.colorbar(shown, cax=below, orientation="horizontal", ticks=[0.0, 0.5, 1.0], format="{x:.0%}")
    bar.outline.set_visible(False)
    below.tick_params(labelsize=SMALL_PT, colors=SOFT, length=0, pad=2)
    said = {"fontsize": SMALL_PT, "color": SOFT, "va": "center"}
    figure.text((COLUMN_IN - 1.8) / COLUMN_IN, 0.295 / height_in, "pale grey: never in range", ha="right", **said)
    return figure


def _names(static: Static) -> tuple[dict[float, str], bool]:
    """Names by place, of robots or if these are many of groups, at their middle; and whether they stand upright."""
    if static.robots <= MAX_NAMED:
        names: dict[float, str] = dict(enumerate(static.robot_names))
    else:
        names = {0.5 * (group.start + group.stop - 1): group.name for group in static.groups}
    names = {place: shortened(name, MAX_LETTERS) for place, name in names.items()}
    return names, sum(len(name) + 1 for name in names.values()) > _LETTERS_ACROSS


def _write(axes: Any, link_pdr: FloatArray) -> None:
    """Percents, in the squares."""
    for sender, receiver in np.argwhere(np.isfinite(link_pdr)).tolist():
        ratio = link_pdr[sender, receiver]
        color = PAPER if ratio < _PALE else INK
        axes.text(receiver, sender, f"{100 * ratio:.0f}", ha="center", va="center", fontsize=5.5, color=color)
