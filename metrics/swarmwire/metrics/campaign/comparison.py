"""Two campaigns, or two parts of one, side by side: every outcome at every design point that both have."""

from collections.abc import Sequence
from dataclasses import dataclass

from swarmwire.comms.config import did_you_mean
from swarmwire.comms.errors import BadInput
from swarmwire.metrics.campaign.about import Point
from swarmwire.metrics.campaign.outcome import Outcome
from swarmwire.metrics.campaign.point_pairs import point_pairs, shared_paths
from swarmwire.metrics.campaign.selection import Selection
from swarmwire.metrics.campaign.statistic import find_outcome
from swarmwire.metrics.statistics.difference import Difference, difference
from swarmwire.metrics.statistics.interval import LEVEL
from swarmwire.metrics.statistics.summary import Summary, summary


@dataclass(frozen=True)
class Row:
    """One outcome at one pair of points."""

    outcome: Outcome
    first_point: Point
    second_point: Point
    first: Summary
    second: Summary
    difference: Difference  # second less first


@dataclass(frozen=True)
class Comparison:
    """Rows by outcome, then by point."""

    first: Selection
    second: Selection
    paths: tuple[str, ...]  # in which the points of every row agree
    rows: tuple[Row, ...]
    level: float  # of the intervals


def compare(first: Selection, second: Selection, outcomes: Sequence[str] = (), level: float = LEVEL) -> Comparison:
    """Compares the named outcomes at points that agree in what both vary.

    Unless any is named: times, the last values of metrics and the delivery ratio, where either has a value. BadInput if
    the two have no such outcome or no point in common.
    """
    pairs = point_pairs(first, second)
    rows = [
        _row(first, second, outcome, *pair, level) for outcome in _outcomes(first, second, outcomes) for pair in pairs
    ]
    if not outcomes:
        rows = [row for row in rows if row.first.n or row.second.n]
    if not rows:
        raise BadInput(f"{first.text}, {second.text}", "", "expected runs with a value: no run of either has one yet")
    return Comparison(first, second, shared_paths(first, second), tuple(rows), level)


def _row(first: Selection, second: Selection, outcome: Outcome, one: int, other: int, level: float) -> Row:
    a, b = first.campaign.sample(outcome.column, one), second.campaign.sample(outcome.column, other)
    return Row(
        outcome,
        first.campaign.points[one],
        second.campaign.points[other],
        summary(a, level),
        summary(b, level),
        difference(a, b, level),
    )


def _outcomes(first: Selection, second: Selection, names: Sequence[str]) -> list[Outcome]:
    """Those named, or the usual ones; BadInput if both do not have them, of one kind."""
    kinds = {outcome.column: outcome.kind for outcome in second.campaign.outcomes}
    common = [outcome for outcome in first.campaign.outcomes if kinds.get(outcome.column) == outcome.kind]
    if not common:
        having = did_you_mean(outcome.column for outcome in first.campaign.outcomes)
        expected = f"expected outcomes in common: the first has {having}; the second {did_you_mean(kinds)}"
        raise BadInput(f"{first.text}, {second.text}", "", expected)
    if names:
        return [find_outcome(name, common) for name in names]
    return [outcome for outcome in common if outcome.is_usual] or common
