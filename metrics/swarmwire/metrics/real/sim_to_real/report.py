"""A sim-to-real comparison for people (texts of its tables, and a page) and for programs (CSV)."""

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

COLUMNS = ("metric", "emulated", "log", "distance", "spread", "KS", "within")  # heads of the table of metrics
RADIO_COLUMNS = ("radio", "emulated", "log", "within")  # and of that of the radio
WITHIN = {True: "yes", False: "no", None: "–"}
NUMBERS = ("runs", "emulated_q05", "emulated_q50", "emulated_q95", "log")  # that metrics and the radio have
METRIC_NUMBERS = ("distance", "spread", "ks", "difference_low", "difference_high")  # that only metrics have
CSV_COLUMNS = ("name", "what", "unit", "kind", *NUMBERS, *METRIC_NUMBERS, "within")
_HEIGHT_IN = 2.1
_BINS = 40
_MAX_RUNS = 40  # that are drawn one by one


def metric_cells(row: MetricRow) -> tuple[str, ...]:
    """The texts of a metric's row, one for each of COLUMNS."""
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
    """The texts of a number of the radio, one for each of RADIO_COLUMNS."""
    unit = f" [{row.of.unit}]" if row.of.unit else ""
    return (row.of.name + unit, spread_text(row.emulated), number_text(row.of.log), WITHIN[row.within])


def spread_text(of: Spread) -> str:
    """The median over runs, and the 5 % and 95 % around it; of a single run its value."""
    if of.low == of.high:
        return number_text(of.median)
    return f"{number_text(of.median)} ({number_text(of.low)} to {number_text(of.high)})"


def verdict(of: SimToReal) -> str:
    """One line: how many of the metrics, and of the radio's numbers, lie within the spread of the runs."""
    if not of.rows and not of.radio:
        return "No number is on both sides: nothing can be said of sim-to-real agreement."
    metrics, radio = [row.within is True for row in of.judged], [row.within is True for row in of.judged_radio]
    outside = [row.metric.name for row in of.judged if not row.within]
    outside += [row.of.name for row in of.judged_radio if not row.within]
    worst = f"; outside: {', '.join(outside)}" if outside else ""
    if of.runs >= MIN_RUNS:
        inside = f"{sum(metrics)} of {len(metrics)} metrics"
        if radio:
            parts = f"{inside}, {sum(radio)} of {len(radio)} of the radio"
            inside = f"{sum(metrics) + sum(radio)} of {len(metrics) + len(radio)} numbers ({parts})"
        return (
            f"{inside} lie within the spread over {of.runs} runs{worst} "
            f"(of one more run about {number_text(of.outside_by_chance)} would lie outside by chance)."
        )
    if of.runs > 1:
        return f"{of.runs} runs have no spread: give {MIN_RUNS} seeds or more."
    more = f" (of the radio's {len(of.radio)} numbers one run allows no statement)" if of.radio else ""
    return (
        f"The means of {sum(metrics)} of {len(metrics)} metrics differ by no more than chance within one run{more}"
        f"{worst}; the spread over seeds needs a campaign."
    )


def meanings(of: SimToReal) -> list[str]:
    """What the numbers mean, a sentence or two a line."""
    lines = [
        f"The first {number_text(of.duration_s)} s are compared, counted from the start of each. "
        "emulated and log: means over ticks"
        + (", of runs the median (5 % to 95 %)." if of.runs > 1 else ".")
        + " distance: Wasserstein-1 between the ticks' values, in the metric's unit; "
        "KS: Kolmogorov and Smirnov's, 0 to 1."
    ]
    if of.runs >= MIN_RUNS:
        lines.append(
            "spread: the greatest distance of one run to all others; within: the log is no farther from all runs. Of "
            "the radio, within: between 5 % and 95 % of the runs."
        )
    elif of.runs == 1:
        lines.append(
            "spread: interval (95 %) of the difference of the means, log less run, by blocks of ticks; "
            "within: it holds 0. What lasts longer than a tenth of the run makes it too narrow."
        )
    lines.append("Ticks of one run depend on one another: there are no p-values.")
    return lines


def left_out(of: SimToReal) -> list[str]:
    """What is not compared, and why, a line each reason."""
    lines = [f"not in the log: {', '.join(names)}: {why}" for why, names in _by_reason(of.not_in_log).items()]
    lines += [f"not compared: {', '.join(names)}: {why}" for why, names in _by_reason(of.not_compared).items()]
    if of.not_in_run:
        lines.append(f"not in the emulated run: {', '.join(of.not_in_run)}")
    if of.undefined:
        lines.append(f"without a value on one side: {', '.join(of.undefined)}")
    if of.never:
        lines.append(f"happened on neither side: {', '.join(of.never)}")
    return lines


def _by_reason(lacks: Mapping[str, str]) -> dict[str, list[str]]:
    found: dict[str, list[str]] = defaultdict(list)
    for name, why in lacks.items():
        found[why].append(name)
    return found


def write_sim_to_real(of: SimToReal, to: Path) -> None:
    """Write a row per metric and number of the radio; BadInput unless the path is that of a .csv that can be written.

    Empty: unknown. `what` is metric or radio; of what was not in the log or not compared, all numbers are empty.
    """
    check_output_path(to, (".csv",))
    with output_file(to) as aside, aside.open("w", encoding="utf-8", newline="") as file:
        writer: csv.DictWriter[str] = csv.DictWriter(file, list(CSV_COLUMNS), restval="")
        writer.writeheader()
        writer.writerows(_rows(of))


def _rows(of: SimToReal) -> list[dict[str, str]]:
    rows: list[dict[str, str]] = []
    for row in of.rows:
        about = {"name": row.metric.name, "what": "metric", "unit": row.metric.unit, "kind": row.metric.kind}
        only = dict(zip(METRIC_NUMBERS, (row.distance, row.reach, row.ks, *row.difference), strict=True))
        numbers = _numbers(len(row.runs), row.emulated, row.log) | only
        rows.append(about | _number_texts(numbers) | {"within": _word(row.within)})
    for row in of.radio:
        about = {"name": row.of.name, "what": "radio", "unit": row.of.unit, "kind": "total"}
        numbers = _numbers(row.runs, row.emulated, row.of.log)
        rows.append(about | _number_texts(numbers) | {"within": _word(row.within)})
    rows += [{"name": name, "what": "not in the log"} for name in of.not_in_log]
    return rows + [{"name": name, "what": "not compared"} for name in of.not_compared]


def _numbers(runs: int, emulated: Spread, log: float) -> dict[str, float]:
    return dict(zip(NUMBERS, (runs, emulated.low, emulated.median, emulated.high, log), strict=True))


def _number_texts(numbers: dict[str, float]) -> dict[str, str]:
    return {name: "" if math.isnan(value) else str(value) for name, value in numbers.items()}


def _word(within: bool | None) -> str:
    return "" if within is None else "yes" if within else "no"


def sim_to_real_report(of: SimToReal, title: str, told: Sequence[str]) -> Report:
    """The page; `told` is what differs in the settings, and what is amiss with the logs, a line each.

    BadInput without matplotlib.
    """
    metrics = ReportTable(COLUMNS, tuple(map(metric_cells, of.rows)), "Metrics over ticks, the worst first.")
    radio = ReportTable(RADIO_COLUMNS, tuple(map(radio_cells, of.radio)), "The radio over the same time.")
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
    return drawn_figure(name, distribution_figure(row), caption)


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
