"""Which share of the runs is still waiting for something, over time: a step curve for each group."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.metrics.drawing.looks import GRID, INK, Look
from swarmwire.metrics.report.figures.column_axes import LETTERS_PT, column_axes
from swarmwire.metrics.report.figures.ordered_colors import ordered_colors

_LEGEND_IN = 0.82


@dataclass(frozen=True)
class SurvivalCurve:
    """A group's estimate; the share is 1 before the first time and holds from each time on."""

    label: str
    time_s: FloatArray  # (k,) ascending, at which it falls
    share: FloatArray  # (k,) of the runs, from that time on
    censored_s: FloatArray  # (c,) ends of runs that were still waiting
    end_s: float  # up to where any run was followed


def survival_curves(curves: Sequence[SurvivalCurve], title: str, x_label: str, legend: str) -> Any:
    """The figure."""
    figure, axes = column_axes(title, x_label, right_in=_LEGEND_IN)
    axes.grid(axis="x", color=GRID, linewidth=0.6)
    for curve, color in zip(curves, ordered_colors(len(curves)), strict=True):
        time_s = np.concatenate(([0.0], curve.time_s, [max(curve.end_s, *curve.time_s, 0.0)]))
        share = np.concatenate(([1.0], curve.share, [curve.share[-1] if len(curve.share) else 1.0]))
        axes.plot(time_s, share, drawstyle="steps-post", color=color, lw=1.3, label=curve.label, solid_capstyle="butt")
        ends_s = np.unique(curve.censored_s)
        if len(ends_s):
            at = share[np.searchsorted(time_s[:-1], ends_s, side="right") - 1]
            mark: Look = {"ms": 5, "mew": 1.1, "ls": "", "clip_on": False, "zorder": 4}
            axes.plot(ends_s, at, "|", color=color, **mark)
    axes.set_ylim(0.0, 1.03)
    axes.set_xlim(0.0, None)
    above: Look = {"title": legend, "title_fontsize": LETTERS_PT, "alignment": "left"}
    axes.legend(
        loc="upper left",
        bbox_to_anchor=(1.01, 1.04),
        frameon=False,
        fontsize=LETTERS_PT,
        labelcolor=INK,
        handlelength=1.2,
        handletextpad=0.5,
        borderaxespad=0.0,
        **above,
    )
    return figure
