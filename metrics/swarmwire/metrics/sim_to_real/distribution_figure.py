"""The distributions of a metric in emulated runs and in a log, one over the other."""

from typing import Any

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.metrics.drawing.style import ACCENT, CURVE, SMALL_PT, SOFT, plain_axes
from swarmwire.metrics.report.page import COLUMN_IN, blank_figure
from swarmwire.metrics.sim_to_real.comparison import MetricRow

_HEIGHT_IN = 2.1
_BINS = 40
_MAX_RUNS = 40  # that are drawn one by one


def distribution_figure(row: MetricRow) -> Any:
    """The shares of ticks by value: of each run faintly, of all runs, and of the log."""
    figure = blank_figure(COLUMN_IN, _HEIGHT_IN)
    unit = f" in {row.metric.unit}" if row.metric.unit else ""
    title = f"{row.metric.name.replace('_', ' ')}{unit}: % of ticks up to a value"
    axes = plain_axes(figure, (0.11, 0.17, 0.86, 0.68), title)
    if len(row.runs) > 1:
        for values in row.runs[:_MAX_RUNS]:
            axes.plot(*_rising(values), color=CURVE, lw=0.5, alpha=0.35)
    axes.plot(*_rising(np.concatenate(row.runs)), color=CURVE, lw=1.4, label="emulated")
    axes.plot(*_rising(row.values), color=ACCENT, lw=1.4, label="log")
    axes.set_ylim(-3.0, 103.0)
    axes.locator_params(axis="y", nbins=4)
    axes.legend(fontsize=SMALL_PT, frameon=False, labelcolor=SOFT, loc="lower right")
    return figure


def _rising(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The distribution function at evenly chosen values, in percent."""
    rising = np.sort(values)
    at = np.unique(np.linspace(0, len(rising) - 1, min(len(rising), 10 * _BINS)).round().astype(np.int64))
    return rising[at], 100.0 * (at + 1.0) / len(rising)
