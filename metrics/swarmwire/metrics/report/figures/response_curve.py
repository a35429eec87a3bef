"""How the median of an outcome answers to a parameter: with its interval, the quartiles, and where it jumps."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.metrics.drawing.looks import CURVE, INK, SOFT, Look
from swarmwire.metrics.report.figures.column_axes import ACCENT, LETTERS_PT, column_axes
from swarmwire.metrics.report.figures.log_axis import fits_log, set_log


@dataclass(frozen=True)
class Response:
    """Medians over the values of a parameter; arrays (k,), inf where it lies beyond the limit, NaN where none is."""

    x: FloatArray  # ascending
    median: FloatArray
    low: FloatArray  # of the median's interval
    high: FloatArray
    q25: FloatArray
    q75: FloatArray


@dataclass(frozen=True)
class Jump:
    """Where the outcome changes most, and the interval in which that place lies."""

    at: float
    low: float
    high: float


def response_curve(
    response: Response, title: str, x_label: str, jump: Jump | None = None, limit: float | None = None
) -> Any:
    """The figure. `limit`: up to where a censored value was followed, None where nothing is censored."""
    figure, axes = column_axes(title, x_label)
    if jump is not None:
        _draw_jump(axes, jump)
    top = np.inf if limit is None else limit
    axes.fill_between(
        response.x,
        _below(response.q25, top),
        _below(response.q75, top),
        color=CURVE,
        alpha=0.12,
        lw=0,
        label="quartiles",
    )
    axes.fill_between(
        response.x, _below(response.low, top), _below(response.high, top), color=CURVE, alpha=0.3, lw=0, label="95 %"
    )
    known = np.isfinite(response.median)
    # NaN where the median is censored: the line breaks there.
    axes.plot(response.x, np.where(known, response.median, np.nan), "o-", color=CURVE, lw=1.3, ms=3, zorder=4)
    if limit is not None:
        axes.axhline(limit, color=SOFT, lw=0.7, ls="--", zorder=1)
        beyond = np.isposinf(response.median)
        mark: Look = {"ms": 4, "mfc": "white", "mec": INK, "mew": 0.8, "zorder": 5, "clip_on": False, "ls": ""}
        axes.plot(response.x[beyond], np.full(int(beyond.sum()), limit), "^", **mark)
    if fits_log(response.x):
        set_log(axes.xaxis)
    if fits_log(np.concatenate([response.q25, response.q75] + ([] if limit is None else [np.array([limit])]))):
        set_log(axes.yaxis)
    return figure


def _below(values: FloatArray, top: float) -> FloatArray:
    """Values with those beyond the limit at the limit; NaN stays."""
    return np.where(np.isposinf(values), top if np.isfinite(top) else np.nan, values)


def _draw_jump(axes: Any, jump: Jump) -> None:
    axes.axvspan(jump.low, jump.high, color=ACCENT, alpha=0.12, lw=0, zorder=0)
    axes.axvline(jump.at, color=ACCENT, lw=1.0, zorder=1)
    at: Look = {"xycoords": ("data", "axes fraction"), "textcoords": "offset points", "va": "top", "color": ACCENT}
    axes.annotate(f"{jump.at:.3g}", (jump.at, 1.0), (3, 7), fontsize=LETTERS_PT, **at)
