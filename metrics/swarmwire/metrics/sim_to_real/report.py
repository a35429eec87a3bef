"""A sim-to-real comparison as a page: the tables, and of each metric both distributions."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.metrics.drawing.style import ACCENT, CURVE, SMALL_PT, SOFT, plain_axes
from swarmwire.metrics.report.page import COLUMN_IN, Figure, Report, Section, Table, as_svg, blank_figure
from swarmwire.metrics.sim_to_real.comparison import MetricRow, SimToReal
from swarmwire.metrics.sim_to_real.texts import (
    COLUMNS,
    RADIO_COLUMNS,
    left_out,
    meanings,
    metric_cells,
    radio_cells,
    verdict,
)
from swarmwire.metrics.text import number_text

_HEIGHT_IN = 2.1
_BINS = 40
_MAX_RUNS = 40  # that are drawn one by one


def sim_to_real_report(of: SimToReal, title: str, told: Sequence[str]) -> Report:
    """The page; `told` is what differs in the settings, and what is amiss with the logs, a line each.

    BadInput without matplotlib.
    """
    metrics = Table(COLUMNS, tuple(map(metric_cells, of.rows)), "Metrics over ticks, the worst first.")
    radio = Table(RADIO_COLUMNS, tuple(map(radio_cells, of.radio)), "The radio over the same time.")
    before = Section("Before the numbers", tuple(f"{line}." for line in told)) if told else None
    drawn = tuple(_figure(row) for row in of.rows if not math.isnan(row.ks))
    sections = (
        Section("Verdict", (verdict(of),)),
        *([before] if before else []),
        Section("Side by side", (metrics, *([radio] if of.radio else []), *meanings(of))),
        Section("Distributions", drawn or ("No metric has a value on both sides.",)),
        Section("Not compared", tuple(f"{line}." for line in left_out(of)) or ("Nothing is left out.",)),
    )
    return Report(title, sections, f"The first {number_text(of.duration_s)} s of each.")


def _figure(row: MetricRow) -> Figure:
    name = f"sim-to-real-{row.metric.name}"
    runs = f"{len(row.runs)} emulated runs, each and all together," if len(row.runs) > 1 else "the emulated run"
    caption = f"`{row.metric.name}` in {runs} and in the log: {row.metric.help or 'the user’s own'}."
    return Figure(name, as_svg(distribution_figure(row), name), caption)


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
