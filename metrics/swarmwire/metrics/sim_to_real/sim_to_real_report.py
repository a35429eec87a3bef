"""A sim-to-real comparison as a page: the tables, and of each metric both distributions."""

import math
from collections.abc import Sequence

from swarmwire.metrics.report.page import Figure, Report, Section, Table, as_svg
from swarmwire.metrics.sim_to_real.comparison import MetricRow, SimToReal
from swarmwire.metrics.sim_to_real.distribution_figure import distribution_figure
from swarmwire.metrics.sim_to_real.sim_to_real_texts import (
    COLUMNS,
    RADIO_COLUMNS,
    left_out,
    meanings,
    metric_cells,
    radio_cells,
    verdict,
)
from swarmwire.metrics.statistics.summary import number_text


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
