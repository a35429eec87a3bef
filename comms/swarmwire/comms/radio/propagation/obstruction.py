"""Obstruction: loss of a link in walls, per obstacle and per metre inside, and the robots that stand in between.

Walls follow the multi-wall model (COST 231 final report, 1999) with exact chords through the obstacles of the arena. A
radio that any obstacle blocks uses `line_of_sight` instead.
"""

# pyright: basic, reportUnknownMemberType=false

import math

import numpy as np

from swarmwire.comms.base.geometry import robot_index
from swarmwire.comms.base.geometry.line_of_sight import cell_number, columns_to_obstacles, rows_to_obstacles
from swarmwire.comms.base.kernels import kernel, njit

PARALLEL = 1e-12  # as in `geometry.ray_to_polygon`


@kernel(from_python=True)
def wall_loss_db(obstacles, entered, arena, crossing_db, inside_db_per_m, ax, ay, bx, by):
    """Loss in dB in walls between two points in m; equal both ways to the last bit. See `crossed_and_inside_m`."""
    crossed, inside_m = crossed_and_inside_m(obstacles, entered, arena, ax, ay, bx, by)
    return crossed * crossing_db + inside_m * inside_db_per_m


@kernel(from_python=True)
def crossed_and_inside_m(obstacles, entered, arena, ax, ay, bx, by):
    """Number of obstacles of the arena that the line between two points enters, and its length inside them in m.

    `obstacles` is an obstacle index, `entered` a buffer (obstacles, 2). A line that only touches an obstacle does not
    enter it; where two overlap, both count.
    """
    if (bx, by) < (ax, ay):  # always from the same end, so that both directions agree to the last bit
        ax, ay, bx, by = bx, by, ax, ay
    dx, dy = bx - ax, by - ay
    length = math.sqrt(dx * dx + dy * dy)
    crossed, inside_m, cells = 0, 0.0, obstacles.cells
    if length == 0.0:
        return crossed, inside_m
    dx, dy = dx / length, dy / length
    first, last = columns_to_obstacles(obstacles, arena, ax, ay, bx, by)
    for column in range(first, last + 1):
        low, high = rows_to_obstacles(obstacles, arena, column, ax, ay, bx, by)
        for row in range(low, high + 1):
            c = cell_number(cells, arena, column, row)
            for at in range(cells.start[c], cells.start[c + 1]):
                k = cells.item[at]
                chord_m = chord_in_obstacle(ax, ay, dx, dy, length, obstacles, k)
                if chord_m > 0.0:
                    crossed = _insert(entered, crossed, k, chord_m)
    for i in range(crossed):  # in the order of obstacles, not of their cells, since the last bit of a sum depends on it
        inside_m += entered[i, 1]
    return crossed, inside_m


@kernel()
def _insert(entered, count, k, chord_m):
    """Insert an obstacle and the length inside it by rising number, unless it is there; returns the number of rows."""
    place = count
    while place > 0 and entered[place - 1, 0] > k:
        place -= 1
    if place > 0 and entered[place - 1, 0] == k:
        return count
    for i in range(count, place, -1):
        entered[i, 0], entered[i, 1] = entered[i - 1, 0], entered[i - 1, 1]
    entered[place, 0], entered[place, 1] = k, chord_m
    return count + 1


@kernel()
def chord_in_obstacle(px, py, dx, dy, length, obstacles, k):
    """As `chord_in_circle`, in obstacle k of an obstacle index."""
    around = obstacles.shape[k]
    chord_m = chord_in_circle(px, py, dx, dy, length, around[0], around[1], around[2])
    if chord_m > 0.0 and obstacles.side_start[k] < obstacles.side_start[k + 1]:
        return chord_in_polygon(px, py, dx, dy, length, obstacles, k)
    return chord_m


@njit()
def chord_in_circle(px, py, dx, dy, length, cx, cy, radius):
    """Length inside a circle of a line of `length` from (px, py) along the unit vector (dx, dy); all in m."""
    along = (cx - px) * dx + (cy - py) * dy
    apart = (cx - px) * dy - (cy - py) * dx
    half2 = radius * radius - apart * apart
    if half2 <= 0.0:
        return 0.0
    half = math.sqrt(half2)
    return max(min(along + half, length) - max(along - half, 0.0), 0.0)


@njit()
def chord_in_polygon(px, py, dx, dy, length, obstacles, k):
    """As `chord_in_circle`, in polygon k: the line is clipped by one side after the other (Cyrus and Beck, 1978)."""
    enter, leave = 0.0, length
    for i in range(obstacles.side_start[k], obstacles.side_start[k + 1]):
        nx, ny = obstacles.side[i, 2], obstacles.side[i, 3]
        outside = nx * px + ny * py - obstacles.side[i, 4]
        speed = nx * dx + ny * dy
        if abs(speed) < PARALLEL:
            if outside >= 0.0:
                return 0.0
        elif speed < 0.0:
            enter = max(enter, -outside / speed)
        else:
            leave = min(leave, -outside / speed)
    return max(leave - enter, 0.0)


@njit()
def bodies_between(x, y, radius_m, grid, robots, a, b):
    """Number of other robots, dead or alive, with their disc on each line between rows a and b, (k,); equal both ways.

    `x`, `y`, `radius_m` (rows,) in m; `grid` lists the `robots` of each arena, and clamps. The cost grows with the
    cells in the line's bounding box.
    """
    counts, max_radius_m = np.empty(len(a), np.int64), radius_m.max()
    for i in range(len(a)):
        counts[i] = _bodies_on_line(x, y, radius_m, max_radius_m, grid, robots, min(a[i], b[i]), max(a[i], b[i]))
    return counts


@njit()
def _bodies_on_line(x, y, radius_m, max_radius_m, grid, robots, a, b):
    left, bottom = min(x[a], x[b]) - max_radius_m, min(y[a], y[b]) - max_radius_m
    right, top = max(x[a], x[b]) + max_radius_m, max(y[a], y[b]) + max_radius_m
    arena, count = a // robots, 0
    first_column, last_column = robot_index.column_of(grid, left), robot_index.column_of(grid, right)
    for j in range(robot_index.row_of(grid, bottom), robot_index.row_of(grid, top) + 1):
        row = (arena * grid.ny + j) * grid.nx
        for at in range(grid.start[row + first_column], grid.start[row + last_column + 1]):
            k = arena * robots + grid.item[at]
            if k not in (a, b) and is_on_line(x[a], y[a], x[b], y[b], x[k], y[k], radius_m[k]):
                count += 1
    return count


@njit()
def is_on_line(ax, ay, bx, by, cx, cy, radius_m):
    """Whether a disc around (cx, cy) covers a point of the line from (ax, ay) to (bx, by); all in m."""
    dx, dy = bx - ax, by - ay
    length2 = dx * dx + dy * dy
    share = 0.0 if length2 == 0.0 else min(max(((cx - ax) * dx + (cy - ay) * dy) / length2, 0.0), 1.0)
    px, py = ax + share * dx - cx, ay + share * dy - cy
    return px * px + py * py < radius_m * radius_m
