"""How the median of a response answers to a parameter: with its interval, the quartiles, and where it jumps."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.metrics.drawing.looks import ACCENT, CURVE, INK, SOFT, Look
from swarmwire.metrics.report.figures.column_axes import LETTERS_PT, column_axes, plain_legend
from swarmwire.metrics.report.figures.log_axis import fits_log, set_log
from swarmwire.metrics.report.figures.ordered_colors import ordered_colors

_APART = 0.012  # of the axis, between the points of several lines


@dataclass(frozen=True)
class Jump:
    """Where the response changes most, and the interval in which that place lies."""

    at: float
    low: float
    high: float


@dataclass(frozen=True)
class MedianLine:
    """Medians over the values of a parameter; arrays (k,), inf where it lies beyond the limit, NaN where none is."""

    label: str
    x: FloatArray  # ascending
    median: FloatArray
    low: FloatArray  # of the median's interval
    high: FloatArray
    q25: FloatArray
    q75: FloatArray
    jump: Jump | None = None


def response_curve(lines: Sequence[MedianLine], title: str, x_label: str, limit: float | None = None) -> Any:
    """The figure; of one line with its quartiles, of several with a legend.

    `limit`: up to where a censored value was followed, None where nothing is censored.
    """
    figure, axes = column_axes(title, x_label)
    alone, log = len(lines) == 1, fits_log(lines[0].x)
    if limit is not None:
        axes.axhline(limit, color=SOFT, lw=0.7, ls="--", zorder=1)
    colors = [CURVE] if alone else ordered_colors(len(lines))
    for place, (line, color) in enumerate(zip(lines, colors, strict=True)):
        x = _aside(line.x, place - 0.5 * (len(lines) - 1), log=log)
        if line.jump is not None and alone:
            _draw_jump(axes, line.jump)
        elif line.jump is not None:
            axes.axvline(line.jump.at, color=color, lw=0.9, ls=(place, (3, len(lines))), zorder=1)
        if alone:
            low, high = _within(line.q25, limit), _within(line.q75, limit)
            axes.fill_between(x, low, high, color=color, alpha=0.18, lw=0)
        low, high = _within(line.low, limit), _within(line.high, limit)
        axes.vlines(x, low, high, color=color, lw=1.0, zorder=3)
        _draw_medians(axes, x, line, limit, color)
    if log:
        set_log(axes.xaxis)
    reached = [quartile for line in lines for quartile in (line.q25, line.q75)]
    if fits_log(np.concatenate(reached + ([] if limit is None else [np.array([limit])]))):
        set_log(axes.yaxis)
    if not alone:
        plain_legend(axes, loc="best")
    return figure


def _aside(x: FloatArray, places: float, *, log: bool) -> FloatArray:
    """Beside one another, so that none hides another's interval."""
    along = np.log(x) if log else x
    moved: FloatArray = along + _APART * places * np.ptp(along)
    return np.exp(moved) if log else moved


def _within(edge: FloatArray, limit: float | None) -> FloatArray:
    """What lies beyond the limit, at the limit."""
    return np.where(np.isposinf(edge), np.nan if limit is None else limit, edge)


def _draw_medians(axes: Any, x: FloatArray, line: MedianLine, limit: float | None, color: Any) -> None:
    known = np.isfinite(line.median)
    # NaN where the median is censored: the line breaks there.
    medians = np.where(known, line.median, np.nan)
    axes.plot(x, medians, "o-", color=color, lw=1.3, ms=3, zorder=4, label=line.label)
    beyond = np.isposinf(line.median)
    if limit is not None and beyond.any():
        mark: Look = {"ms": 4, "mfc": "white", "mec": INK, "mew": 0.8, "zorder": 5, "clip_on": False, "ls": ""}
        axes.plot(x[beyond], np.full(int(beyond.sum()), limit), "^", **mark)


def _draw_jump(axes: Any, jump: Jump) -> None:
    axes.axvspan(jump.low, jump.high, color=ACCENT, alpha=0.12, lw=0, zorder=0)
    axes.axvline(jump.at, color=ACCENT, lw=1.0, zorder=1)
    at: Look = {"xycoords": ("data", "axes fraction"), "textcoords": "offset points", "va": "top", "color": ACCENT}
    axes.annotate(f"{jump.at:.3g}", (jump.at, 1.0), (3, 7), fontsize=LETTERS_PT, **at)
