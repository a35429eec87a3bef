"""Where a disc ends up that must not stand in obstacles or walls: pushed out the shortest way, so that it slides along.

Compiled. Only obstacles that are listed for the disc's cell are looked at, in their order: the same ones push, and in
the same order, as if all were.
"""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np
from numba import njit

from swarmwire.comms.geometry.obstacles import Obstacles
from swarmwire.comms.geometry.robot_index import Cells, column_of, row_of
from swarmwire.comms.kernels import borrowing

PASSES = 8  # in a corner, what one thing pushes out of itself another may push back
EPSILON_M = 1e-9  # touching by rounding is no overlap


class Hindrance(NamedTuple):
    """What holds discs back in every arena, as kernels take it."""

    half_x_m: float
    half_y_m: float
    walled: bool
    wraps: bool
    obstacles: Obstacles
    cells: Cells  # each lists, rising, circle k as k and polygon k as k + circles: those whose circle is within reach


@njit(cache=True)
def shortest(apart_m, half_m, wraps):
    """A difference of coordinates, on a torus that of the nearest images."""
    return apart_m - 2.0 * half_m * np.floor((apart_m + half_m) / (2.0 * half_m)) if wraps else apart_m


@borrowing()
def any_near(around, arena, x, y, reach_m, bottom_m):
    """Whether the circle around any obstacle that is taller than `bottom_m` lies within reach of a point.

    The reach is at most that for which the obstacles were listed.
    """
    cells, obstacles, circles = around.cells, around.obstacles, len(around.obstacles.circle)
    c = _cell(cells, arena, x, y)
    for at in range(cells.start[c], cells.start[c + 1]):
        k = cells.item[at]
        if k < circles:
            near = obstacles.circle_top_m[k] > bottom_m and _within(around, obstacles.circle, k, x, y, reach_m)
        else:
            k -= circles
            near = obstacles.polygon_top_m[k] > bottom_m and _within(around, obstacles.polygon, k, x, y, reach_m)
        if near:
            return True
    return False


@borrowing()
def _cell(cells, arena, x, y):
    return (arena * cells.ny + row_of(cells, y)) * cells.nx + column_of(cells, x)


@borrowing()
def _within(around, circle, k, x, y, reach_m):
    dx = shortest(x - circle[k, 0], around.half_x_m, around.wraps)
    dy = shortest(y - circle[k, 1], around.half_y_m, around.wraps)
    reach = reach_m + circle[k, 2]
    return dx * dx + dy * dy < reach * reach


@borrowing()
def held_back(around, arena, x, y, radius_m, bottom_m, near):
    """The place x, y of a disc after it is pushed out, whether it was, and whether it is free there.

    Obstacles are asked only if they are `near`, and only those taller than `bottom_m`.
    """
    pushed = False
    for _ in range(PASSES):
        ax, ay = x, y
        if near:
            x, y = _out_of_obstacles(around, arena, x, y, radius_m, bottom_m)
        if around.walled:
            most_x, most_y = around.half_x_m - radius_m, around.half_y_m - radius_m
            x, y = min(max(x, -most_x), most_x), min(max(y, -most_y), most_y)
        if abs(x - ax) <= EPSILON_M and abs(y - ay) <= EPSILON_M:
            return x, y, pushed, True
        pushed = True
    return x, y, True, False


@borrowing()
def _out_of_obstacles(around, arena, x, y, radius_m, bottom_m):
    """Out of one obstacle after the other; who is pushed into another cell goes on with what is listed there."""
    cells, circles = around.cells, len(around.obstacles.circle)
    c = _cell(cells, arena, x, y)
    at = cells.start[c]
    while at < cells.start[c + 1]:
        k = cells.item[at]
        at += 1
        if k < circles:
            out_x, out_y = _out_of_circle(around, k, x, y, radius_m, bottom_m)
        else:
            out_x, out_y = _out_of_sides(around, k - circles, x, y, radius_m, bottom_m)
        if out_x == x and out_y == y:
            continue
        x, y, before = out_x, out_y, c
        c = _cell(cells, arena, x, y)
        if c != before:
            at = cells.start[c]
            while at < cells.start[c + 1] and cells.item[at] <= k:
                at += 1
    return x, y


@borrowing()
def _out_of_circle(around, k, x, y, radius_m, bottom_m):
    obstacles = around.obstacles
    dx = shortest(x - obstacles.circle[k, 0], around.half_x_m, around.wraps)
    dy = shortest(y - obstacles.circle[k, 1], around.half_y_m, around.wraps)
    apart, distance = radius_m + obstacles.circle[k, 2], np.sqrt(dx * dx + dy * dy)
    if obstacles.circle_top_m[k] <= bottom_m or not 0.0 < distance < apart:
        return x, y
    return x + dx / distance * (apart - distance), y + dy / distance * (apart - distance)


@borrowing()
def _out_of_sides(around, k, x, y, radius_m, bottom_m):
    obstacles = around.obstacles
    if obstacles.polygon_top_m[k] <= bottom_m or not _within(around, obstacles.polygon, k, x, y, radius_m):
        return x, y
    # The image of the disc that is nearest to the polygon.
    cx, cy = obstacles.polygon[k, 0], obstacles.polygon[k, 1]
    px = cx + shortest(x - cx, around.half_x_m, around.wraps)
    py = cy + shortest(y - cy, around.half_y_m, around.wraps)
    start, stop = obstacles.side_start[k], obstacles.side_start[k + 1]
    dx, dy = _out_of_polygon(obstacles.side, start, stop, px, py, radius_m)
    return x + dx, y + dy


@borrowing()
def _out_of_polygon(side, start, stop, x, y, radius_m):
    """The shortest way by which a disc leaves a convex polygon, (0, 0) if it is clear."""
    beyond, outer = -np.inf, start  # the side that the centre is furthest beyond, or least behind
    for s in range(start, stop):
        apart = side[s, 2] * x + side[s, 3] * y - side[s, 4]
        if apart > beyond:
            beyond, outer = apart, s
    if beyond >= radius_m:
        return 0.0, 0.0
    if beyond <= 0.0:
        return side[outer, 2] * (radius_m - beyond), side[outer, 3] * (radius_m - beyond)
    least2, nearest_x, nearest_y = np.inf, 0.0, 0.0
    for s in range(start, stop):
        ax, ay = side[s, 0], side[s, 1]
        after = s + 1 if s + 1 < stop else start
        bx, by = side[after, 0] - ax, side[after, 1] - ay
        share = min(max(((x - ax) * bx + (y - ay) * by) / (bx * bx + by * by), 0.0), 1.0)
        dx, dy = x - ax - share * bx, y - ay - share * by
        if dx * dx + dy * dy < least2:
            least2, nearest_x, nearest_y = dx * dx + dy * dy, dx, dy
    distance = np.sqrt(least2)
    if distance >= radius_m:
        return 0.0, 0.0
    return nearest_x / distance * (radius_m - distance), nearest_y / distance * (radius_m - distance)
