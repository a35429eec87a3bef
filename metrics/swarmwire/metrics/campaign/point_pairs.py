"""Which design points of two campaigns are compared with one another."""

from typing import NamedTuple

from swarmwire.comms.errors import BadInput
from swarmwire.metrics.campaign.point_values import point_text, same_value
from swarmwire.metrics.campaign.selection import Selection


class PointPair(NamedTuple):
    """Numbers of two points."""

    first: int
    second: int


def shared_paths(first: Selection, second: Selection) -> tuple[str, ...]:
    """Parameters that must agree: both vary them, and for neither one value was chosen."""
    free = set(second.campaign.parameters) - first.pinned - second.pinned
    return tuple(path for path in first.campaign.parameters if path in free)


def point_pairs(first: Selection, second: Selection) -> list[PointPair]:
    """Points that agree in what both vary, in the first's order; BadInput if there are none, or nothing tells which."""
    paths = shared_paths(first, second)
    if not paths and len(first.points) > 1 and len(second.points) > 1:
        expected = f"expected a parameter that both vary: {_paths(first)} and {_paths(second)}; choose points with @"
        raise BadInput(_both(first, second), "", expected)
    pairs = [
        PointPair(one, other)
        for one in first.points
        for other in second.points
        if all(same_value(first.campaign.points[one][path], second.campaign.points[other][path]) for path in paths)
    ]
    if not pairs:
        expected = f"expected design points in common: {_example(first, paths)} and {_example(second, paths)}"
        raise BadInput(_both(first, second), "", expected)
    return pairs


def _both(first: Selection, second: Selection) -> str:
    return f"{first.text}, {second.text}"


def _paths(of: Selection) -> str:
    return f"one varies {', '.join(of.campaign.parameters)}"


def _example(of: Selection, paths: tuple[str, ...]) -> str:
    first = point_text(of.campaign.points[of.points[0]], paths)
    return f"one has {first}" + (f" and {len(of.points) - 1} others" if len(of.points) > 1 else "")
