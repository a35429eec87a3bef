"""A sim-to-real comparison as texts of tables, as a page, and as CSV."""

import csv
import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.atomic import check_output_path, output_file
from swarmwire.metrics.pictures.drawing.canvas import ACCENT, CURVE, SMALL_PT, SOFT, plain_axes
from swarmwire.metrics.pictures.report.page import (
    COLUMN_IN,
    Figure,
    Report,
    ReportTable,
    Section,
    blank_figure,
    drawn_figure,
)
from swarmwire.metrics.real.sim_to_real.comparison import MIN_RUNS, MetricRow, RadioRow, SimToReal, Spread
from swarmwire.metrics.statistics.summary import interval_text
from swarmwire.metrics.text import number_text

COLUMNS = ("metric", "emulated", "log", "distance", "spread", "KS", "within")  # table of metrics
RADIO_COLUMNS = ("radio", "emulated", "log", "within")  # table of the radio
WITHIN = {True: "yes", False: "no", None: "–"}
NUMBERS = ("runs", "emulated_q05", "emulated_q50", "emulated_q95", "log")  # common columns of metrics and radio
METRIC_NUMBERS = ("distance", "spread", "ks", "difference_low", "difference_high")  # columns of metrics
CSV_COLUMNS = ("name", "what", "unit", "kind", *NUMBERS, *METRIC_NUMBERS, "within")
_HEIGHT_IN = 2.1
_BINS = 40
_MAX_RUNS = 40  # runs with their own curves


def metric_cells(row: MetricRow) -> tuple[str, ...]:
    """Return the texts of a metric's row, one per column of COLUMNS."""
    unit = "1/s" if row.metric.kind == "count" else row.metric.unit
    reach = interval_text(row.difference, sign=True) if math.isnan(row.reach) else number_text(row.reach)
    return (
        row.metric.name + (f" [{unit}]" if unit else ""),
        spread_text(row.emulated),
        number_text(row.log),
        number_text(row.distance),
        reach,
        number_text(row.ks),
        WITHIN[row.within],
    )


def radio_cells(row: RadioRow) -> tuple[str, ...]:
    """Return the texts of a number of the radio, one per column of RADIO_COLUMNS."""
    unit = f" [{row.value.unit}]" if row.value.unit else ""
    return (row.value.name + unit, spread_text(row.emulated), number_text(row.value.log), WITHIN[row.within])


def spread_text(spread: Spread) -> str:
    """Return the median over runs with the 5 % and 95 % quantiles; the value of a single run."""
    if spread.low == spread.high:
        return number_text(spread.median)
    return f"{number_text(spread.median)} ({number_text(spread.low)} to {number_text(spread.high)})"


def verdict(comparison: SimToReal) -> str:
    """Return a line on the number of metrics, and of the radio's numbers, within the spread of the runs."""
    if not comparison.rows and not comparison.radio:
        return "No number is on both sides: nothing can be said of sim-to-real agreement."
    metrics = [row.within is True for row in comparison.judged]
    radio = [row.within is True for row in comparison.judged_radio]
    outside = [row.metric.name for row in comparison.judged if not row.within]
    outside += [row.value.name for row in comparison.judged_radio if not row.within]
    worst = f"; outside: {', '.join(outside)}" if outside else ""
    if comparison.runs >= MIN_RUNS:
        inside = f"{sum(metrics)} of {len(metrics)} metrics"
        if radio:
            parts = f"{inside}, {sum(radio)} of {len(radio)} of the radio"
            inside = f"{sum(metrics) + sum(radio)} of {len(metrics) + len(radio)} numbers ({parts})"
        return (
            f"{inside} lie within the spread over {comparison.runs} runs{worst} "
            f"(of one more run about {number_text(comparison.outside_by_chance)} would lie outside by chance)."
        )
    if comparison.runs > 1:
        return f"{comparison.runs} runs have no spread: give {MIN_RUNS} seeds or more."
    more = f" (of the radio's {len(comparison.radio)} numbers one run allows no statement)" if comparison.radio else ""
    return (
        f"The means of {sum(metrics)} of {len(metrics)} metrics differ by no more than chance within one run{more}"
        f"{worst}; the spread over seeds needs a campaign."
    )


def meanings(comparison: SimToReal) -> list[str]:
    """Return explanations of the numbers, a sentence or two per line."""
    lines = [
        f"The first {number_text(comparison.duration_s)} s are compared, counted from the start of each. "
        "emulated and log: means over ticks"
        + (", of runs the median (5 % to 95 %)." if comparison.runs > 1 else ".")
        + " distance: Wasserstein-1 between the ticks' values, in the metric's unit; "
        "KS: Kolmogorov and Smirnov's, 0 to 1."
    ]
    if comparison.runs >= MIN_RUNS:
        lines.append(
            "spread: the greatest distance of one run to all others; within: the log is no farther from all runs. Of "
            "the radio, within: between 5 % and 95 % of the runs."
        )
    elif comparison.runs == 1:
        lines.append(
            "spread: interval (95 %) of the difference of the means, log less run, by blocks of ticks; "
            "within: it holds 0. What lasts longer than a tenth of the run makes it too narrow."
        )
    lines.append("Ticks of one run depend on one another: there are no p-values.")
    return lines


def left_out(comparison: SimToReal) -> list[str]:
    """Return the metrics that are not compared, a line per reason."""
    lines = [f"not in the log: {', '.join(names)}: {why}" for why, names in _by_reason(comparison.not_in_log).items()]
    lines += [f"not compared: {', '.join(names)}: {why}" for why, names in _by_reason(comparison.not_compared).items()]
    if comparison.not_in_run:
        lines.append(f"not in the emulated run: {', '.join(comparison.not_in_run)}")
    if comparison.undefined:
        lines.append(f"without a value on one side: {', '.join(comparison.undefined)}")
    if comparison.never:
        lines.append(f"happened on neither side: {', '.join(comparison.never)}")
    return lines


def _by_reason(reasons: Mapping[str, str]) -> dict[str, list[str]]:
    names: dict[str, list[str]] = defaultdict(list)
    for name, reason in reasons.items():
        names[reason].append(name)
    return names


def write_sim_to_real(comparison: SimToReal, to: Path) -> None:
    """Write a row per metric and number of the radio; BadInput unless a .csv can be written to the path.

    Empty: unknown. `what` is metric or radio; without data in the log or a comparison, all numbers are empty.
    """
    check_output_path(to, (".csv",))
    with output_file(to) as part, part.open("w", encoding="utf-8", newline="") as file:
        writer: csv.DictWriter[str] = csv.DictWriter(file, list(CSV_COLUMNS), restval="")
        writer.writeheader()
        writer.writerows(_rows(comparison))


def _rows(comparison: SimToReal) -> list[dict[str, str]]:
    rows: list[dict[str, str]] = []
    for row in comparison.rows:
        about = {"name": row.metric.name, "what": "metric", "unit": row.metric.unit, "kind": row.metric.kind}
        distances = dict(zip(METRIC_NUMBERS, (row.distance, row.reach, row.ks, *row.difference), strict=True))
        numbers = _numbers(len(row.runs), row.emulated, row.log) | distances
        rows.append(about | _number_texts(numbers) | {"within": _word(row.within)})
    for row in comparison.radio:
        about = {"name": row.value.name, "what": "radio", "unit": row.value.unit, "kind": "total"}
        numbers = _numbers(row.runs, row.emulated, row.value.log)
        rows.append(about | _number_texts(numbers) | {"within": _word(row.within)})
    rows += [{"name": name, "what": "not in the log"} for name in comparison.not_in_log]
    return rows + [{"name": name, "what": "not compared"} for name in comparison.not_compared]


def _numbers(runs: int, emulated: Spread, log: float) -> dict[str, float]:
    return dict(zip(NUMBERS, (runs, emulated.low, emulated.median, emulated.high, log), strict=True))


def _number_texts(numbers: dict[str, float]) -> dict[str, str]:
    return {name: "" if math.isnan(value) else str(value) for name, value in numbers.items()}


def _word(within: bool | None) -> str:
    return "" if within is None else "yes" if within else "no"


def sim_to_real_report(comparison: SimToReal, title: str, notes: Sequence[str]) -> Report:
    """Return the report; `notes` are differences of settings and problems of the logs, a line each.

    BadInput without matplotlib.
    """
    metrics = ReportTable(COLUMNS, tuple(map(metric_cells, comparison.rows)), "Metrics over ticks, the worst first.")
    radio = ReportTable(RADIO_COLUMNS, tuple(map(radio_cells, comparison.radio)), "The radio over the same time.")
    before = Section("Before the numbers", tuple(f"{line}." for line in notes)) if notes else None
    drawn = tuple(_figure(row) for row in comparison.rows if not math.isnan(row.ks))
    sections = (
        Section("Verdict", (verdict(comparison),)),
        *([before] if before else []),
        Section("Side by side", (metrics, *([radio] if comparison.radio else []), *meanings(comparison))),
        Section("Distributions", drawn or ("No metric has a value on both sides.",)),
        Section("Not compared", tuple(f"{line}." for line in left_out(comparison)) or ("Nothing is left out.",)),
    )
    return Report(title, sections, f"The first {number_text(comparison.duration_s)} s of each.")


def _figure(row: MetricRow) -> Figure:
    name = f"sim-to-real-{row.metric.name}"
    runs = f"{len(row.runs)} emulated runs, each and all together," if len(row.runs) > 1 else "the emulated run"
    caption = f"`{row.metric.name}` in {runs} and in the log: {row.metric.help or 'custom'}."
    return drawn_figure(name, distribution_figure(row), caption)


def distribution_figure(row: MetricRow) -> Any:
    """Draw the distribution functions of each run (faint), of all runs, and of the log."""
    figure = blank_figure(COLUMN_IN, _HEIGHT_IN)
    unit = f" in {row.metric.unit}" if row.metric.unit else ""
    title = f"{row.metric.name.replace('_', ' ')}{unit}: % of ticks up to a value"
    axes = plain_axes(figure, (0.11, 0.17, 0.86, 0.68), title)
    if len(row.runs) > 1:
        for values in row.runs[:_MAX_RUNS]:
            axes.plot(*_distribution(values), color=CURVE, lw=0.5, alpha=0.35)
    axes.plot(*_distribution(np.concatenate(row.runs)), color=CURVE, lw=1.4, label="emulated")
    axes.plot(*_distribution(row.values), color=ACCENT, lw=1.4, label="log")
    axes.set_ylim(-3.0, 103.0)
    axes.locator_params(axis="y", nbins=4)
    axes.legend(fontsize=SMALL_PT, frameon=False, labelcolor=SOFT, loc="lower right")
    return figure


def _distribution(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return values and percents of the distribution function, at evenly spaced ranks."""
    ascending = np.sort(values)
    rank = np.unique(np.linspace(0, len(ascending) - 1, min(len(ascending), 10 * _BINS)).round().astype(np.int64))
    return ascending[rank], 100.0 * (rank + 1.0) / len(ascending)
