"""Convex polygons: the one shape with corners that the world knows."""

from collections.abc import Sequence

Point = tuple[float, float]
MOST_POINTS = 100


def counter_clockwise(points: Sequence[Point]) -> tuple[Point, ...]:
    """These corners of a convex polygon, turned counter-clockwise; ValueError says what is wrong with them."""
    if not 3 <= len(points) <= MOST_POINTS:
        raise ValueError(f"expected 3 to {MOST_POINTS} points, got {len(points)}")
    turned = tuple(points) if _turn(points[0], points[1], points[2]) > 0.0 else tuple(reversed(points))
    for i, start in enumerate(turned):
        after = (i + 1) % len(turned)
        end = turned[after]
        for j, other in enumerate(turned):
            if j not in (i, after) and not _turn(start, end, other) > 0.0:
                raise ValueError(
                    "expected the corners of a convex polygon in order; "
                    f"({other[0]:g}, {other[1]:g}) lies on or beyond the side from "
                    f"({start[0]:g}, {start[1]:g}) to ({end[0]:g}, {end[1]:g})"
                )
    return turned


def _turn(a: Point, b: Point, c: Point) -> float:
    """Twice the area of the triangle a, b, c; positive if it is counter-clockwise."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
