"""Obstruction: loss of a link in walls, per obstacle and per metre inside, and the robots on a link's line.

A link is a straight line in space between antennas at the heights z. An obstacle counts where the line is below its
top, the body of a robot where the line is between the body's lower side, at the robot's z, and its top. Walls follow
the multi-wall model (COST 231 final report, 1999) with exact chords through the obstacles of the arena. Radios that
obstacles block use `line_of_sight` instead.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, FloatArray, IntArray
from swarmwire.comms.base.geometry import robot_index
from swarmwire.comms.base.geometry.line_of_sight import (
    cell_number,
    columns_to_obstacles,
    length_below_m,
    rows_to_obstacles,
)
from swarmwire.comms.base.geometry.obstacle_index import ObstacleIndex
from swarmwire.comms.base.geometry.robot_index import Grid
from swarmwire.comms.base.kernels import kernel, njit

PARALLEL = 1e-12  # same bound as `geometry.ray_to_polygon`


@kernel(from_python=True)
def wall_loss_db(
    obstacles: ObstacleIndex,
    entered: Any,
    arena: int,
    crossing_db: float,
    inside_db_per_m: float,
    ax: float,
    ay: float,
    az: float,
    bx: float,
    by: float,
    bz: float,
):
    """Return the loss in walls between two points in m, in dB; equal both ways to the last bit.

    `obstacles` and `entered` are those of `crossed_and_inside_m`.
    """
    crossed, inside_m = crossed_and_inside_m(obstacles, entered, arena, ax, ay, az, bx, by, bz)
    return crossed * crossing_db + inside_m * inside_db_per_m


@kernel(from_python=True)
def crossed_and_inside_m(
    obstacles: ObstacleIndex, entered: AnyArray, arena: int, ax: Any, ay: Any, az: Any, bx: Any, by: Any, bz: Any
):
    """Return the number of the arena's obstacles that the line between two points enters, and its length inside in m.

    `obstacles` is an obstacle index, `entered` a buffer (obstacles, 2). A line that only touches an obstacle, or that
    passes over it, does not enter it; nothing is between two points one above the other. Overlapping obstacles both
    count.
    """
    if (bz, bx, by) < (az, ax, ay):  # from the lower end; one order of the ends: both directions agree to the last bit
        ax, ay, az, bx, by, bz = bx, by, bz, ax, ay, az
    dx, dy = bx - ax, by - ay
    length = math.sqrt(dx * dx + dy * dy)  # over the floor
    crossed, inside_m, cells = 0, 0.0, obstacles.cells
    if length == 0.0:
        return crossed, inside_m
    dx, dy = dx / length, dy / length
    first, last = columns_to_obstacles(obstacles, arena, ax, ay, bx, by)
    for column in range(first, last + 1):
        low, high = rows_to_obstacles(obstacles, arena, column, ax, ay, bx, by)
        for row in range(low, high + 1):
            c = cell_number(cells, arena, column, row)
            for i in range(cells.start[c], cells.start[c + 1]):
                k = cells.item[i]
                top_m = obstacles.shape[k, 3]
                if top_m <= az:
                    continue
                below_m = length_below_m(length, az, bz, top_m)
                chord_m = chord_in_obstacle(ax, ay, dx, dy, below_m, obstacles, k)
                if chord_m > 0.0:
                    slope = (bz - az) / length
                    crossed = _insert(entered, crossed, k, chord_m * math.sqrt(1.0 + slope * slope))
    for i in range(crossed):  # sorted by obstacle, not by cell: the last bit of the sum depends on the order
        inside_m += entered[i, 1]
    return crossed, inside_m


@kernel()
def _insert(entered: AnyArray, count: int, k: int, chord_m: float):
    """Insert an obstacle and the length inside it, sorted by number, without repetition; return the number of rows."""
    row = count
    while row > 0 and entered[row - 1, 0] > k:
        row -= 1
    if row > 0 and entered[row - 1, 0] == k:
        return count
    for i in range(count, row, -1):
        entered[i, 0], entered[i, 1] = entered[i - 1, 0], entered[i - 1, 1]
    entered[row, 0], entered[row, 1] = k, chord_m
    return count + 1


@kernel()
def chord_in_obstacle(px: float, py: float, dx: float, dy: float, length: float, obstacles: ObstacleIndex, k: int):
    """Return the length inside obstacle k of an obstacle index; the other parameters are those of `chord_in_circle`."""
    cx, cy, radius = obstacles.shape[k, 0], obstacles.shape[k, 1], obstacles.shape[k, 2]
    chord_m = chord_in_circle(px, py, dx, dy, length, cx, cy, radius)
    if chord_m > 0.0 and obstacles.side_start[k] < obstacles.side_start[k + 1]:
        return chord_in_polygon(px, py, dx, dy, length, obstacles, k)
    return chord_m


@njit()
def chord_in_circle(px: float, py: float, dx: float, dy: float, length: float, cx: float, cy: float, radius: float):
    """Return the length in a circle of a line of `length` from (px, py) along the unit vector (dx, dy); all in m."""
    along = (cx - px) * dx + (cy - py) * dy
    across = (cx - px) * dy - (cy - py) * dx
    half_chord2 = radius * radius - across * across
    if half_chord2 <= 0.0:
        return 0.0
    half_chord = math.sqrt(half_chord2)
    return max(min(along + half_chord, length) - max(along - half_chord, 0.0), 0.0)


@njit()
def chord_in_polygon(px: float, py: float, dx: float, dy: float, length: float, obstacles: ObstacleIndex, k: int):
    """Return the length inside polygon k, by clipping the line at one side after the other (Cyrus and Beck, 1978)."""
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


class BodyParams(NamedTuple):
    """The bodies of robots, upright cylinders, as input of kernels."""

    x: FloatArray  # (rows,)
    y: FloatArray  # (rows,)
    z: FloatArray  # (rows,) height of the lower side
    radius_m: FloatArray  # (rows,)
    height_m: FloatArray  # (rows,) from the lower side to the top
    max_radius_m: float
    grid: Grid  # sorted; it clamps
    robots: int  # robots per arena


@njit()
def bodies_between(bodies: BodyParams, a: IntArray, b: IntArray):
    """Return the number of other robots, dead or alive, whose body each line between rows a and b crosses, (k,).

    Equal both ways. The cost grows with the cells in the line's bounding box.
    """
    counts = np.empty(len(a), np.int64)
    for i in range(len(a)):
        counts[i] = bodies_on_line(bodies, min(a[i], b[i]), max(a[i], b[i]))
    return counts


@kernel()
def bodies_on_line(bodies: Any, a: int, b: int):
    """Return the number of other robots whose body the line between rows a < b crosses; `bodies_between` for one."""
    x, y, grid, max_radius_m = bodies.x, bodies.y, bodies.grid, bodies.max_radius_m
    left, bottom = min(x[a], x[b]) - max_radius_m, min(y[a], y[b]) - max_radius_m
    right, top = max(x[a], x[b]) + max_radius_m, max(y[a], y[b]) + max_radius_m
    arena, count = a // bodies.robots, 0
    first_column, last_column = robot_index.column_of(grid, left), robot_index.column_of(grid, right)
    for j in range(robot_index.row_of(grid, bottom), robot_index.row_of(grid, top) + 1):
        first_cell = (arena * grid.ny + j) * grid.nx
        for i in range(grid.start[first_cell + first_column], grid.start[first_cell + last_column + 1]):
            k = arena * bodies.robots + grid.item[i]
            if k not in (a, b) and _is_body_on_line(bodies, a, b, k):
                count += 1
    return count


@kernel()
def _is_body_on_line(bodies: Any, a: Any, b: Any, k: Any):
    """Return True if the body of row k covers a point of the line between rows a and b."""
    ax, ay, bx, by = bodies.x[a], bodies.y[a], bodies.x[b], bodies.y[b]
    x, y, radius_m = bodies.x[k], bodies.y[k], bodies.radius_m[k]
    if not is_on_line(ax, ay, bx, by, x, y, radius_m):  # decides most bodies
        return False
    az, bz, bottom_m, top_m = bodies.z[a], bodies.z[b], bodies.z[k], bodies.z[k] + bodies.height_m[k]
    if max(az, bz) < bottom_m or min(az, bz) >= top_m:
        return False
    first_x, first_y = _end_between(ax, ay, az, bx, by, bz, bottom_m, top_m)
    last_x, last_y = _end_between(bx, by, bz, ax, ay, az, bottom_m, top_m)
    return is_on_line(first_x, first_y, last_x, last_y, x, y, radius_m)


@kernel()
def _end_between(x: Any, y: Any, z: Any, to_x: Any, to_y: Any, to_z: Any, bottom_m: Any, top_m: Any):
    """Return the end x, y of a line, or the point nearest to it that is between two heights."""
    height_m = min(max(z, bottom_m), top_m)
    share = 0.0 if height_m == z else (height_m - z) / (to_z - z)
    return x + share * (to_x - x), y + share * (to_y - y)


@njit()
def is_on_line(ax: float, ay: float, bx: float, by: float, cx: Any, cy: Any, radius_m: Any):
    """Return True if the disc with centre (cx, cy) covers a point of the line from (ax, ay) to (bx, by); all in m."""
    dx, dy = bx - ax, by - ay
    length2 = dx * dx + dy * dy
    share = 0.0 if length2 == 0.0 else min(max(((cx - ax) * dx + (cy - ay) * dy) / length2, 0.0), 1.0)
    px, py = ax + share * dx - cx, ay + share * dy - cy
    return px * px + py * py < radius_m * radius_m
