"""Two campaigns, or two parts of one, side by side: every response at every design point that both have.

The numbers, the same as a table for programs (CSV), and as texts for people.
"""

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from swarmwire.comms.base.atomic import check_output_path, output_file
from swarmwire.comms.base.config import did_you_mean
from swarmwire.comms.base.errors import BadInput
from swarmwire.metrics.records.campaign.folder import PointSelection, point_pairs, shared_paths
from swarmwire.metrics.records.campaign.spec import FAILED, Point, Response, find_response, point_text, value_text
from swarmwire.metrics.statistics.difference import Difference, difference
from swarmwire.metrics.statistics.sample import LEVEL
from swarmwire.metrics.statistics.summary import SKEWED_SAMPLE, Summary, interval_text, quartiles_text, summary
from swarmwire.metrics.text import number_text

SUMMARIES = ("n", "failed", "undefined", "censored", "q25", "q50", "q75", "mean", "limit")
COLUMNS = ("response", "at", "A", "B", "B - A", "interval", "delta", "p", "pairs")
MEANINGS = {
    "Wilcoxon signed-rank": (
        "B - A of numbers in pairs: the median of the differences seed by seed, of pairs alone (A, B: of all runs); "
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
    difference: Difference  # second less first


@dataclass(frozen=True)
class CampaignComparison:
    """Rows by response, then by point."""

    first: PointSelection
    second: PointSelection
    paths: tuple[str, ...]  # in which the points of every row agree
    rows: tuple[ComparisonRow, ...]
    level: float  # of the intervals


def compare(
    first: PointSelection, second: PointSelection, responses: Sequence[str] = (), level: float = LEVEL
) -> CampaignComparison:
    """Compares the named responses at points that agree in what both vary.

    Unless any is named: times, the last values of metrics and the link PDR, where either has a value. BadInput if the
    two have no such response or no point in common.
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
    first: PointSelection, second: PointSelection, response: Response, one: int, other: int, level: float
) -> ComparisonRow:
    a, b = first.campaign.sample(response.column, one), second.campaign.sample(response.column, other)
    return ComparisonRow(
        response,
        first.campaign.points[one],
        second.campaign.points[other],
        summary(a, level),
        summary(b, level),
        difference(a, b, level),
    )


def _responses(first: PointSelection, second: PointSelection, names: Sequence[str]) -> list[Response]:
    """Those named, or the usual ones; BadInput if both do not have them, of one kind."""
    kinds = {response.column: response.kind for response in second.campaign.responses}
    common = [response for response in first.campaign.responses if kinds.get(response.column) == response.kind]
    if not common:
        having = did_you_mean(response.column for response in first.campaign.responses)
        expected = f"expected responses in common: the first has {having}; the second {did_you_mean(kinds)}"
        raise BadInput(f"{first.text}, {second.text}", "", expected)
    if names:
        return [find_response(name, common) for name in names]
    return [response for response in common if response.is_usual] or common


def write_comparison(comparison: CampaignComparison, to: Path) -> None:
    """Write a row per response and pair of points; BadInput unless the path is that of a .csv that can be written.

    Columns: response, unit, kind; `a.PATH`, `b.PATH` of each parameter; `a_`, `b_` n, failed, undefined, censored, q25,
    q50, q75, mean, limit; pairs, median_difference with _low and _high, mean_difference with _low and _high, horizon,
    cliffs_delta, hedges_g, p, test. Empty: unknown; inf: open.
    """
    check_output_path(to, (".csv",))
    rows = [_cells(row) for row in comparison.rows]
    with output_file(to) as aside, aside.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


def _cells(row: ComparisonRow) -> dict[str, str]:
    of = row.difference
    cells = {"response": row.response.column, "unit": row.response.unit, "kind": row.response.kind}
    cells |= {f"a.{path}": value_text(value) for path, value in row.first_point.items()}
    cells |= {f"b.{path}": value_text(value) for path, value in row.second_point.items()}
    numbers = _summary("a", row.first) | _summary("b", row.second)
    numbers |= {
        "pairs": of.pairs,
        "median_difference": of.median,
        "median_difference_low": of.median_interval.low,
        "median_difference_high": of.median_interval.high,
        "mean_difference": of.mean,
        "mean_difference_low": of.mean_interval.low,
        "mean_difference_high": of.mean_interval.high,
        "horizon": of.horizon,
        "cliffs_delta": of.delta,
        "hedges_g": of.g,
        "p": of.p,
    }
    cells |= {name: "" if math.isnan(value) else str(value) for name, value in numbers.items()}
    return cells | {"test": of.test}


def _summary(letter: str, of: Summary) -> dict[str, float]:
    return {f"{letter}_{name}": getattr(of, name) for name in SUMMARIES}


# Heads of a comparison's table.


def cells(comparison: CampaignComparison, row: ComparisonRow) -> tuple[str, ...]:
    """The texts of a row, one for each of COLUMNS."""
    of = row.difference
    shown, interval = (of.mean, of.mean_interval) if of.is_discrete else (of.median, of.median_interval)
    unit = f" [{row.response.unit}]" if row.response.unit else ""
    return (
        row.response.column + unit,
        _place(comparison, row),
        quartiles_text(row.first),
        quartiles_text(row.second),
        number_text(shown, sign=True) + (" (mean)" if of.is_discrete else ""),
        interval_text(interval, sign=True),
        number_text(of.delta, sign=True),
        p_text(of.p),
        str(of.pairs) if of.pairs else f"none ({row.first.n}, {row.second.n})",
    )


def p_text(p: float) -> str:
    """A p-value with two digits.

    >>> p_text(0.0123), p_text(1e-9)
    ('0.012', '< 0.0001')
    """
    return "< 0.0001" if p < 1e-4 else number_text(p) if math.isnan(p) else f"{p:.2g}"


def notes(comparison: CampaignComparison) -> list[str]:
    """What the table means, a sentence or two a line, and what is missing in it."""
    percent = f"{100.0 * comparison.level:g} %"
    lines = [
        f"{letter}: {of.text} ({_state(of)})" for letter, of in (("A", comparison.first), ("B", comparison.second))
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
    if len(comparison.rows) > 1:
        chance = len(comparison.rows) * (1.0 - comparison.level)
        lines.append(f"Of {len(comparison.rows)} rows about {chance:.1g} would leave 0 out of the interval by chance.")
    return lines


def _skewed(comparison: CampaignComparison) -> list[str]:
    """A warning where an interval of means is that of a skewed sample."""
    shown = [row for row in comparison.rows if row.difference.is_discrete and row.difference.is_skewed]
    places = [f"{row.response.column} at {_place(comparison, row)}" for row in shown]
    return [f"{'; '.join(places)}: {SKEWED_SAMPLE}."] if places else []


def _other_signs(comparison: CampaignComparison) -> list[str]:
    """A note where the medians seem to say the opposite of B - A."""
    places = [
        f"{row.response.column} at {_place(comparison, row)}"
        for row in comparison.rows
        if row.difference.pairs and (row.second.q50 - row.first.q50) * row.difference.median < 0.0
    ]
    if not places:
        return []
    return [
        f"{'; '.join(places)}: B - A and the medians of A and B differ in sign. B - A is the median of the differences "
        "within seeds, which need not be the difference of the medians."
    ]


def _stopped_first(comparison: CampaignComparison) -> list[str]:
    """A warning of each time before which a stop condition ended runs."""
    lines: list[str] = []
    for column in dict.fromkeys(row.response.column for row in comparison.rows):
        found = [of for row in comparison.rows if row.response.column == column for of in (row.first, row.second)]
        count = sum(of.stopped_first for of in found)
        if count:
            shortest = min(of.shortest for of in found if of.stopped_first)
            lines.append(
                f"{column}: [stop] ended {count} of {sum(of.n for of in found)} runs before it, the first after "
                f"{number_text(shortest)} s. If the condition has to do with the event, medians, B - A and p mislead; "
                "keep_running = true in [stop] avoids this."
            )
    return lines


def _place(comparison: CampaignComparison, row: ComparisonRow) -> str:
    """Where both are the same, then what only one of them has or was chosen to have."""
    parts = [point_text(row.first_point, comparison.paths)]
    for letter, point in (("A", row.first_point), ("B", row.second_point)):
        own = point_text(point, [path for path in point if path not in comparison.paths])
        parts.append(f"{letter}: {own}" if own else "")
    return "; ".join(part for part in parts if part) or "all"


def _state(of: PointSelection) -> str:
    campaign = of.campaign
    runs = campaign.runs.filter(campaign.runs["point"].is_in(of.points))
    asked = len(of.points) * len(campaign.about.seeds)
    failed = int((runs["ended"] == FAILED).sum())
    parts = [f"{len(runs)} runs" if len(runs) == asked else f"not finished: {len(runs)} of {asked} runs"]
    return ", ".join([*parts, f"{failed} failed"] if failed else parts)
