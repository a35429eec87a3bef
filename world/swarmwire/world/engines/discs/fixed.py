"""Gaps between a disc and what is fixed: walls, circles, sides and corners of convex polygons. Compiled."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.kernels import borrowing

ROBOT, LEFT, RIGHT, BOTTOM, TOP, CIRCLE, POLYGON = range(7)  # kinds of things that a disc may meet


@borrowing()
def gap_to_wall(wall, x, y, radius_m, half_size_m):
    """Gap in m from a disc to a wall of the arena, negative if they overlap, and the unit vector towards the wall."""
    if wall == LEFT:
        return half_size_m[0] + x - radius_m, -1.0, 0.0
    if wall == RIGHT:
        return half_size_m[0] - x - radius_m, 1.0, 0.0
    if wall == BOTTOM:
        return half_size_m[1] + y - radius_m, 0.0, -1.0
    return half_size_m[1] - y - radius_m, 0.0, 1.0


@borrowing()
def gap_to_circle(x, y, radius_m, circle_x, circle_y, circle_radius_m):
    """As `gap_to_wall`, to a circle. Two with one centre part along x."""
    dx, dy = circle_x - x, circle_y - y
    apart = np.sqrt(dx * dx + dy * dy)
    if apart == 0.0:
        return -radius_m - circle_radius_m, 1.0, 0.0
    return apart - radius_m - circle_radius_m, dx / apart, dy / apart


@borrowing(from_python=True)
def gap_to_polygon(x, y, radius_m, polygon, side_start, side):
    """As `gap_to_wall`, to the side or corner of a convex polygon that is nearest to the disc's centre.

    That is on the side whose line has the centre farthest outside, or, where its foot lies beyond that side, one of
    the side's two corners.
    """
    first, end = side_start[polygon], side_start[polygon + 1]
    outside, nearest = -np.inf, first
    for k in range(first, end):
        here = side[k, 2] * x + side[k, 3] * y - side[k, 4]
        if here > outside:
            outside, nearest = here, k
    nx, ny = side[nearest, 2], side[nearest, 3]
    if outside > 0.0:
        after = nearest + 1 if nearest + 1 < end else first
        # The side runs along (-ny, nx), its normal turned left.
        if (y - side[nearest, 1]) * nx - (x - side[nearest, 0]) * ny < 0.0:
            return gap_to_circle(x, y, radius_m, side[nearest, 0], side[nearest, 1], 0.0)
        if (y - side[after, 1]) * nx - (x - side[after, 0]) * ny > 0.0:
            return gap_to_circle(x, y, radius_m, side[after, 0], side[after, 1], 0.0)
    return outside - radius_m, -nx, -ny


@borrowing()
def gap_to_fixed(kind, which, x, y, radius_m, half_size_m, circle, side_start, side):
    """As `gap_to_wall`, to any thing: circle or polygon number `which`, or a wall."""
    if kind == CIRCLE:
        return gap_to_circle(x, y, radius_m, circle[which, 0], circle[which, 1], circle[which, 2])
    if kind == POLYGON:
        return gap_to_polygon(x, y, radius_m, which, side_start, side)
    return gap_to_wall(kind, x, y, radius_m, half_size_m)
