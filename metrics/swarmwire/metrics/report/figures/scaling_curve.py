"""What more robots bring: efficiency, and the share of the work that does not gain from them."""

from typing import Any

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.metrics.drawing.looks import CURVE, SOFT
from swarmwire.metrics.report.figures.column_axes import column_axes
from swarmwire.metrics.report.figures.log_axis import fits_log, set_log


def scaling_curve(robots: FloatArray, value: FloatArray, title: str, level: float) -> Any:
    """The figure of a value (k,) over numbers of robots (k,); `level`: what it would be if robots cost nothing."""
    figure, axes = column_axes(title, "robots")
    axes.axhline(level, color=SOFT, lw=0.7, ls="--", zorder=1)
    known = np.isfinite(value)
    axes.plot(robots[known], value[known], "o-", color=CURVE, lw=1.3, ms=3.6)
    if fits_log(robots):
        set_log(axes.xaxis)
    axes.set_xticks(robots, [f"{count:g}" for count in robots])
    return figure
