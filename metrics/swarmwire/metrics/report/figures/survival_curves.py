"""Which share of the runs is still waiting for something, over time: a step curve for each group."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.metrics.drawing.looks import GRID, Look
from swarmwire.metrics.report.figures.column_axes import column_axes, plain_legend
from swarmwire.metrics.report.figures.ordered_colors import ordered_colors

_LEGEND_IN = 0.72
_MAX_CORNERS, _MAX_TICKS = 300, 60


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
    """The corners from 0 to the end, of which no more than can be told apart."""
    time_s = np.concatenate(([0.0], curve.time_s, [max(curve.end_s, *curve.time_s, 0.0)]))
    share = np.concatenate(([1.0], curve.share, [curve.share[-1] if len(curve.share) else 1.0]))
    if len(time_s) <= _MAX_CORNERS:
        return time_s, share
    grid: FloatArray = np.linspace(0.0, float(time_s[-1]), _MAX_CORNERS)
    last = np.unique(np.searchsorted(time_s, grid, side="right") - 1)
    return time_s[last], share[last]
