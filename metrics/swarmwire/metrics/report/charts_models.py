"""Charts of models: performance under stress, scaling with robots, and survival over time."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.metrics.drawing.style import ACCENT, CURVE, GRID, INK, SOFT, Look
from swarmwire.metrics.report.axes import column_axes, fits_log, ordered_colors, plain_legend, set_log

_LEGEND_IN = 0.72
_MAX_CORNERS, _MAX_TICKS = 300, 60


@dataclass(frozen=True)
class FittedShape:
    """A fit at shares (g,)."""

    label: str
    share: FloatArray
    value: FloatArray
    better: bool  # than the other


def resilience_curve(
    share: FloatArray,
    value: FloatArray,
    low: FloatArray,
    high: FloatArray,
    shapes: Sequence[FittedShape],
    title: str,
    x_label: str,
) -> Any:
    """The figure of values (k,) with their intervals, over shares (k,) that were lost."""
    figure, axes = column_axes(title, x_label)
    axes.axhline(1.0, color=SOFT, lw=0.7, ls=":", zorder=1)
    lines: Look = {"color": CURVE, "lw": 1.0, "zorder": 3, "clip_on": False}
    axes.vlines(share, low, high, **lines)
    axes.plot(share, value, "o", color=CURVE, ms=3.6, zorder=4, clip_on=False)
    for shape in shapes:
        look: Look = {"color": ACCENT, "lw": 1.4} if shape.better else {"color": INK, "lw": 0.9, "ls": (0, (4, 2))}
        axes.plot(shape.share, shape.value, label=shape.label, zorder=2, **look)
    axes.set_ylim(min(0.0, float(low.min())), None)
    axes.set_xlim(-0.03 * float(share[-1]), None)
    plain_legend(axes, loc="best")
    return figure


def scaling_curve(robots: FloatArray, value: FloatArray, title: str, level: float) -> Any:
    """The figure of a value (k,) over numbers of robots (k,); `level`: the value of ideal scaling."""
    figure, axes = column_axes(title, "robots")
    axes.axhline(level, color=SOFT, lw=0.7, ls="--", zorder=1)
    known = np.isfinite(value)
    axes.plot(robots[known], value[known], "o-", color=CURVE, lw=1.3, ms=3.6)
    if fits_log(robots):
        set_log(axes.xaxis)
    axes.set_xticks(robots, [f"{count:g}" for count in robots])
    return figure


@dataclass(frozen=True)
class SurvivalCurve:
    """A group's estimate; the share is 1 before the first time and holds from each time on."""

    label: str
    time_s: FloatArray  # (k,) ascending, at which it falls
    share: FloatArray  # (k,) of the runs, from that time on
    censored_s: FloatArray  # (c,) ends of runs that were still waiting
    end_s: float  # up to where any run was followed


def survival_curves(curves: Sequence[SurvivalCurve], title: str, x_label: str) -> Any:
    """The figure."""
    figure, axes = column_axes(title, x_label, right_in=_LEGEND_IN if len(curves) > 1 else 0.1)
    axes.grid(axis="x", color=GRID, linewidth=0.6)
    for curve, color in zip(curves, ordered_colors(len(curves)), strict=True):
        time_s, share = _steps(curve)
        axes.plot(time_s, share, drawstyle="steps-post", color=color, lw=1.3, label=curve.label, solid_capstyle="butt")
        ends_s = np.unique(curve.censored_s)
        ends_s = ends_s[:: -(-len(ends_s) // _MAX_TICKS) or 1]
        if len(ends_s):
            at = share[np.maximum(np.searchsorted(time_s, ends_s, side="right") - 1, 0)]
            mark: Look = {"ms": 5, "mew": 1.1, "ls": "", "clip_on": False, "zorder": 4}
            axes.plot(ends_s, at, "|", color=color, **mark)
    axes.set_ylim(0.0, 1.03)
    axes.set_xlim(0.0, None)
    if len(curves) > 1:
        plain_legend(axes, loc="upper left", bbox_to_anchor=(1.01, 1.03), handletextpad=0.5)
    return figure


def _steps(curve: SurvivalCurve) -> tuple[FloatArray, FloatArray]:
    """The corners from 0 to the end, at most _MAX_CORNERS."""
    time_s = np.concatenate(([0.0], curve.time_s, [max(curve.end_s, *curve.time_s, 0.0)]))
    share = np.concatenate(([1.0], curve.share, [curve.share[-1] if len(curve.share) else 1.0]))
    if len(time_s) <= _MAX_CORNERS:
        return time_s, share
    grid: FloatArray = np.linspace(0.0, float(time_s[-1]), _MAX_CORNERS)
    last = np.unique(np.searchsorted(time_s, grid, side="right") - 1)
    return time_s[last], share[last]
