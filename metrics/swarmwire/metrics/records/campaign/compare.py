"""Comparison of two campaigns, or of two parts of one: every response at every design point that both have.

The result is numbers, a CSV table for programs, and texts for people.
"""

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from swarmwire.comms.base.atomic import check_output_path, output_file
from swarmwire.comms.base.config import did_you_mean
from swarmwire.comms.base.errors import BadInput
from swarmwire.metrics.records.campaign.campaign_json import (
    FAILED,
    Point,
    Response,
    find_response,
    point_text,
    value_text,
)
from swarmwire.metrics.records.campaign.folder import PointSelection, point_pairs, shared_paths
from swarmwire.metrics.statistics.difference import Difference, difference
from swarmwire.metrics.statistics.sample import LEVEL, Interval
from swarmwire.metrics.statistics.summary import SKEWED_SAMPLE, Summary, interval_text, quartiles_text, summary
from swarmwire.metrics.text import number_text

SUMMARIES = ("n", "failed", "undefined", "censored", "q25", "q50", "q75", "mean", "limit")
COLUMNS = ("response", "at", "A", "B", "B - A", "interval", "delta", "p", "pairs")
MEANINGS = {
    "Wilcoxon signed-rank": (
        "B - A of numbers in pairs: the median of the differences seed by seed, of pairs only (A, B: all runs); "
        "p: Wilcoxon's signed-rank test."
    ),
    "Mann-Whitney": "B - A of numbers without pairs: the difference of the medians; p: the test of Mann and Whitney.",
    "paired Gehan": (
        "B - A of times in pairs: the difference of Kaplan and Meier's medians, resampled seed by seed; "
        "p: the paired Wilcoxon test for censored times."
    ),
    "log-rank": "B - A of times without pairs: the difference of Kaplan and Meier's medians; p: the log-rank test.",
}


@dataclass(frozen=True)
class ComparisonRow:
    """One response at one pair of points."""

    response: Response
    first_point: Point
    second_point: Point
    first: Summary
    second: Summary
    difference: Difference  #: second - first


@dataclass(frozen=True)
class CampaignComparison:
    """Rows by response, then by point."""

    first: PointSelection
    second: PointSelection
    paths: tuple[str, ...]  #: parameters with equal values at both points of every row
    rows: tuple[ComparisonRow, ...]
    level: float  #: confidence level of the intervals


def compare(
    first: PointSelection, second: PointSelection, responses: Sequence[str] = (), level: float = LEVEL
) -> CampaignComparison:
    """Compare the named responses at points that agree in the parameters that both vary.

    By default: times, the last values of metrics and the link PDR, if either campaign has a value. BadInput if the two
    have no such response or no point in common.
    """
    pairs = point_pairs(first, second)
    rows = [
        _row(first, second, response, *pair, level)
        for response in _responses(first, second, responses)
        for pair in pairs
    ]
    if not responses:
        rows = [row for row in rows if row.first.n or row.second.n]
    if not rows:
        raise BadInput(f"{first.text}, {second.text}", "", "expected runs with a value: no run of either has one yet")
    return CampaignComparison(first, second, shared_paths(first, second), tuple(rows), level)


def _row(
    first: PointSelection, second: PointSelection, response: Response, first_index: int, second_index: int, level: float
) -> ComparisonRow:
    a, b = first.campaign.sample(response.column, first_index), second.campaign.sample(response.column, second_index)
    return ComparisonRow(
        response,
        first.campaign.points[first_index],
        second.campaign.points[second_index],
        summary(a, level),
        summary(b, level),
        difference(a, b, level),
    )


def _responses(first: PointSelection, second: PointSelection, names: Sequence[str]) -> list[Response]:
    """Return the responses of these names, or the usual ones; BadInput if not both have them, of the same kind."""
    kinds = {response.column: response.kind for response in second.campaign.responses}
    common = [response for response in first.campaign.responses if kinds.get(response.column) == response.kind]
    if not common:
        columns = did_you_mean(response.column for response in first.campaign.responses)
        expected = f"expected responses in common: the first has {columns}; the second {did_you_mean(kinds)}"
        raise BadInput(f"{first.text}, {second.text}", "", expected)
    if names:
        return [find_response(name, common) for name in names]
    return [response for response in common if response.is_usual] or common


def write_comparison(comparison: CampaignComparison, to: Path) -> None:
    """Write a row per response and pair of points; BadInput if the path is no .csv, or cannot be written.

    Columns: response, unit, kind; `a.PATH`, `b.PATH` of each parameter; `a_`, `b_` n, failed, undefined, censored, q25,
    q50, q75, mean, limit; pairs, median_difference with _low and _high, mean_difference with _low and _high, horizon,
    cliffs_delta, hedges_g, p, test. Empty: unknown; inf: open.
    """
    check_output_path(to, (".csv",))
    rows = [_cells(row) for row in comparison.rows]
    with output_file(to) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


def _cells(row: ComparisonRow) -> dict[str, str]:
    difference = row.difference
    cells = {"response": row.response.column, "unit": row.response.unit, "kind": row.response.kind}
    cells |= {f"a.{path}": value_text(value) for path, value in row.first_point.items()}
    cells |= {f"b.{path}": value_text(value) for path, value in row.second_point.items()}
    numbers = _summary("a", row.first) | _summary("b", row.second)
    numbers |= {
        "pairs": difference.pairs,
        "median_difference": difference.median,
        "median_difference_low": difference.median_interval.low,
        "median_difference_high": difference.median_interval.high,
        "mean_difference": difference.mean,
        "mean_difference_low": difference.mean_interval.low,
        "mean_difference_high": difference.mean_interval.high,
        "horizon": difference.horizon,
        "cliffs_delta": difference.delta,
        "hedges_g": difference.g,
        "p": difference.p,
    }
    cells |= {name: "" if math.isnan(value) else str(value) for name, value in numbers.items()}
    return cells | {"test": difference.test}


def _summary(letter: str, summary: Summary) -> dict[str, float]:
    return {f"{letter}_{name}": getattr(summary, name) for name in SUMMARIES}


def cells(comparison: CampaignComparison, row: ComparisonRow) -> tuple[str, ...]:
    """Return the texts of a row, one for each of COLUMNS."""
    difference, interval = row.difference, _shown_interval(row)
    if difference.is_discrete:
        value_text = f"{number_text(difference.mean, sign=True)} (mean)"
    else:
        value_text = number_text(difference.median, sign=True)
    unit = f" [{row.response.unit}]" if row.response.unit else ""
    return (
        row.response.column + unit,
        _points_text(comparison, row),
        quartiles_text(row.first),
        quartiles_text(row.second),
        value_text,
        interval_text(interval, sign=True),
        number_text(difference.delta, sign=True),
        p_text(difference.p),
        str(difference.pairs) if difference.pairs else f"none ({row.first.n}, {row.second.n})",
    )


def _shown_interval(row: ComparisonRow) -> Interval:
    return row.difference.mean_interval if row.difference.is_discrete else row.difference.median_interval


def p_text(p: float) -> str:
    """Format a p-value with two digits.

    >>> p_text(0.0123), p_text(1e-9)
    ('0.012', '< 0.0001')
    """
    return "< 0.0001" if p < 1e-4 else number_text(p) if math.isnan(p) else f"{p:.2g}"


def notes(comparison: CampaignComparison) -> list[str]:
    """Return lines that explain the table and its gaps."""
    percent = f"{100.0 * comparison.level:g} %"
    lines = [
        f"{letter}: {selection.text} ({_run_counts(selection)})"
        for letter, selection in (("A", comparison.first), ("B", comparison.second))
    ]
    lines.append("A and B: median (quartiles); > means later than the runs were observed.")
    lines += _stopped_first(comparison)
    tests = dict.fromkeys(row.difference.test for row in comparison.rows)
    lines += [MEANINGS[test] for test in tests]
    if any(row.difference.is_discrete for row in comparison.rows):
        lines.append("(mean): the outcome has few distinct values, so B - A and its interval are of the means.")
    lines += _skewed(comparison)
    lines += _other_signs(comparison)
    lines.append(f"interval: where B - A lies with {percent} confidence, by the bootstrap.")
    lines.append(
        "delta (Cliff's): share of pairs of runs in which B is greater, less the share in which A is; -1 to 1."
    )
    intervals = sum(not math.isnan(_shown_interval(row).low) for row in comparison.rows)  # one seed has none
    if intervals > 1:
        chance = intervals * (1.0 - comparison.level)
        lines.append(f"Of {intervals} intervals about {chance:.1g} would leave 0 out by chance.")
    return lines


def _skewed(comparison: CampaignComparison) -> list[str]:
    """Return a warning if an interval of means is that of a skewed sample."""
    skewed = [row for row in comparison.rows if row.difference.is_discrete and row.difference.is_skewed]
    names = [f"{row.response.column} at {_points_text(comparison, row)}" for row in skewed]
    return [f"{'; '.join(names)}: {SKEWED_SAMPLE}."] if names else []


def _other_signs(comparison: CampaignComparison) -> list[str]:
    """Return a note if the difference of the medians and B - A differ in sign."""
    names = [
        f"{row.response.column} at {_points_text(comparison, row)}"
        for row in comparison.rows
        if row.difference.pairs and (row.second.q50 - row.first.q50) * row.difference.median < 0.0
    ]
    if not names:
        return []
    return [
        f"{'; '.join(names)}: B - A and the medians of A and B differ in sign. B - A is the median of the differences "
        "within seeds, which need not be the difference of the medians."
    ]


def _stopped_first(comparison: CampaignComparison) -> list[str]:
    """Return a warning for each time that runs lack because a stop condition ended them first."""
    lines: list[str] = []
    for column in dict.fromkeys(row.response.column for row in comparison.rows):
        rows = [row for row in comparison.rows if row.response.column == column]
        summaries = [summary for row in rows for summary in (row.first, row.second)]
        count = sum(summary.stopped_first for summary in summaries)
        if count:
            shortest = min(summary.shortest for summary in summaries if summary.stopped_first)
            lines.append(
                f"{column}: [stop] ended {count} of {sum(summary.n for summary in summaries)} runs before it, "
                f"the first after {number_text(shortest)} s. If the condition has to do with the event, medians, B - A "
                "and p mislead; keep_running = true in [stop] avoids this."
            )
    return lines


def _points_text(comparison: CampaignComparison, row: ComparisonRow) -> str:
    """Return the parameters that both points share, then those of A only and of B only."""
    parts = [point_text(row.first_point, comparison.paths)]
    for letter, point in (("A", row.first_point), ("B", row.second_point)):
        text = point_text(point, [path for path in point if path not in comparison.paths])
        parts.append(f"{letter}: {text}" if text else "")
    return "; ".join(part for part in parts if part) or "all"


def _run_counts(selection: PointSelection) -> str:
    campaign = selection.campaign
    runs = campaign.runs.filter(campaign.runs["point"].is_in(selection.points))
    planned = len(selection.points) * len(campaign.about.seeds)
    failed = int((runs["ended"] == FAILED).sum())
    parts = [f"{len(runs)} runs" if len(runs) == planned else f"not finished: {len(runs)} of {planned} runs"]
    return ", ".join([*parts, f"{failed} failed"] if failed else parts)
