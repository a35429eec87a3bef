"""A comparison as people read it: cells of a table, and what they mean."""

import math

from swarmwire.metrics.campaign.comparison import Comparison, Row
from swarmwire.metrics.campaign.formats import FAILED
from swarmwire.metrics.campaign.point_values import point_text
from swarmwire.metrics.campaign.selection import Selection
from swarmwire.metrics.statistics.summary import interval_text, quartiles_text
from swarmwire.metrics.text import number_text

# Heads of a comparison's table.
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


def cells(comparison: Comparison, row: Row) -> tuple[str, ...]:
    """The texts of a row, one for each of COLUMNS."""
    of = row.difference
    unit = f" [{row.response.unit}]" if row.response.unit else ""
    return (
        row.response.column + unit,
        _place(comparison, row),
        quartiles_text(row.first),
        quartiles_text(row.second),
        number_text(of.median, sign=True),
        interval_text(of.median_interval, sign=True),
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


def notes(comparison: Comparison) -> list[str]:
    """What the table means, a sentence or two a line, and what is missing in it."""
    percent = f"{100.0 * comparison.level:g} %"
    lines = [
        f"{letter}: {of.text} ({_state(of)})" for letter, of in (("A", comparison.first), ("B", comparison.second))
    ]
    lines.append("A and B: median (quartiles); > means later than the runs were watched.")
    tests = dict.fromkeys(row.difference.test for row in comparison.rows)
    lines += [MEANINGS[test] for test in tests]
    lines.append(f"interval: where B - A lies with {percent} confidence, by the bootstrap.")
    lines.append(
        "delta (Cliff's): share of pairs of runs in which B is greater, less the share in which A is; -1 to 1."
    )
    if len(comparison.rows) > 1:
        chance = len(comparison.rows) * (1.0 - comparison.level)
        lines.append(f"Of {len(comparison.rows)} rows about {chance:.1g} would leave 0 out of the interval by chance.")
    return lines


def _place(comparison: Comparison, row: Row) -> str:
    """Where both are the same, then what only one of them has or was chosen to have."""
    parts = [point_text(row.first_point, comparison.paths)]
    for letter, point in (("A", row.first_point), ("B", row.second_point)):
        own = point_text(point, [path for path in point if path not in comparison.paths])
        parts.append(f"{letter}: {own}" if own else "")
    return "; ".join(part for part in parts if part) or "all"


def _state(of: Selection) -> str:
    campaign = of.campaign
    runs = campaign.runs.filter(campaign.runs["point"].is_in(of.points))
    asked = len(of.points) * len(campaign.about.seeds)
    failed = int((runs["ended"] == FAILED).sum())
    parts = [f"{len(runs)} runs" if len(runs) == asked else f"not finished: {len(runs)} of {asked} runs"]
    return ", ".join([*parts, f"{failed} failed"] if failed else parts)
