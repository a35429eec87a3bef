"""Two campaigns, or two parts of one, side by side: every response at every design point that both have."""

from collections.abc import Sequence
from dataclasses import dataclass

from swarmwire.comms.config import did_you_mean
from swarmwire.comms.errors import BadInput
from swarmwire.metrics.campaign.about import Point
from swarmwire.metrics.campaign.point_pairs import point_pairs, shared_paths
from swarmwire.metrics.campaign.response import Response
from swarmwire.metrics.campaign.selection import Selection
from swarmwire.metrics.campaign.statistic import find_response
from swarmwire.metrics.statistics.difference import Difference, difference
from swarmwire.metrics.statistics.sample import LEVEL
from swarmwire.metrics.statistics.summary import Summary, summary


@dataclass(frozen=True)
class Row:
    """One response at one pair of points."""

    response: Response
    first_point: Point
    second_point: Point
    first: Summary
    second: Summary
    difference: Difference  # second less first


@dataclass(frozen=True)
class Comparison:
    """Rows by response, then by point."""

    first: Selection
    second: Selection
    paths: tuple[str, ...]  # in which the points of every row agree
    rows: tuple[Row, ...]
    level: float  # of the intervals


def compare(first: Selection, second: Selection, responses: Sequence[str] = (), level: float = LEVEL) -> Comparison:
    """Compares the named responses at points that agree in what both vary.

    Unless any is named: times, the last values of metrics and the delivery ratio, where either has a value. BadInput if
    the two have no such response or no point in common.
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
    return Comparison(first, second, shared_paths(first, second), tuple(rows), level)


def _row(first: Selection, second: Selection, response: Response, one: int, other: int, level: float) -> Row:
    a, b = first.campaign.sample(response.column, one), second.campaign.sample(response.column, other)
    return Row(
        response,
        first.campaign.points[one],
        second.campaign.points[other],
        summary(a, level),
        summary(b, level),
        difference(a, b, level),
    )


def _responses(first: Selection, second: Selection, names: Sequence[str]) -> list[Response]:
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
