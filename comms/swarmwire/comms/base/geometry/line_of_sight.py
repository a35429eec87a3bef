"""Straight lines in space: the cells of the floor below them, and the obstacles that touch them. Compiled.

Obstacles stand on the floor: one touches a line only where the line is below its top. The cost grows with the cells
along a line, not with the obstacles of its arena.
"""

from typing import Any

import numpy as np

from swarmwire.comms.base.geometry.obstacle_index import ObstacleIndex, ray_to_obstacle
from swarmwire.comms.base.geometry.obstacles import to_nearest
from swarmwire.comms.base.geometry.robot_index import Grid
from swarmwire.comms.base.kernels import kernel

MARGIN_M = 1e-9  # a line along the border of two cells is in both


@kernel()
def cell_at(at_m: float, per_m: float, cells: int):
    """Return the column or row of a coordinate, not wrapped."""
    return int(np.floor(at_m * per_m + 0.5 * cells))


@kernel()
def rows_along(cells: Grid, column: int, margin_m: float, x: float, y: float, to_x: float, to_y: float):
    """Return the first and last row of a column, not wrapped, within `margin_m` of the line."""
    low, high = min(y, to_y), max(y, to_y)
    if to_x != x:
        wide_m, slope = 1.0 / cells.per_x, (to_y - y) / (to_x - x)  # divided once for all columns: kernels are inlined
        left = (column - 0.5 * cells.nx) * wide_m - margin_m
        right = (column + 1.0 - 0.5 * cells.nx) * wide_m + margin_m
        y_left = y + slope * (max(left, min(x, to_x)) - x)
        y_right = y + slope * (min(right, max(x, to_x)) - x)
        low, high = max(low, min(y_left, y_right)), min(high, max(y_left, y_right))
    return cell_at(low - margin_m, cells.per_y, cells.ny), cell_at(high + margin_m, cells.per_y, cells.ny)


@kernel()
def columns_to_obstacles(obstacles: ObstacleIndex, arena: int, x: float, y: float, to_x: float, to_y: float):
    """Return the first and last column, not wrapped, in which an obstacle may touch the line; last < first if none can.

    `obstacles` is an obstacle index. A line has no columns beyond the outermost obstacles of its arena.
    """
    extent, cells = obstacles.extent, obstacles.cells
    left, right = max(min(x, to_x), extent[arena, 0]), min(max(x, to_x), extent[arena, 2])
    low, high = max(min(y, to_y), extent[arena, 1]), min(max(y, to_y), extent[arena, 3])
    if left > right or low > high:
        return 0, -1
    if cells.nx * cells.ny == 1:
        return 0, 0
    return cell_at(left, cells.per_x, cells.nx), cell_at(right, cells.per_x, cells.nx)


@kernel()
def rows_to_obstacles(obstacles: ObstacleIndex, arena: int, column: int, x: float, y: float, to_x: float, to_y: float):
    """Return the rows of a column, as `columns_to_obstacles` does the columns."""
    extent, cells = obstacles.extent, obstacles.cells
    if cells.nx * cells.ny == 1:
        return 0, 0
    low, high = rows_along(cells, column, MARGIN_M, x, y, to_x, to_y)
    bottom = cell_at(extent[arena, 1], cells.per_y, cells.ny)
    return max(low, bottom), min(high, cell_at(extent[arena, 3], cells.per_y, cells.ny))


@kernel()
def cell_number(cells: Grid, arena: int, column: int, row: Any):
    """Return the cell of a column and row that are not wrapped."""
    row = row if 0 <= row < cells.ny else row % cells.ny
    return (arena * cells.ny + row) * cells.nx + (column if 0 <= column < cells.nx else column % cells.nx)


@kernel()
def is_beside(x: float, y: float, to_x: float, to_y: float, obstacles: ObstacleIndex, k: int):
    """Return True if both ends of a line are beyond the same side of an obstacle, so that it misses for any rounding.

    The test decides most lines without a division.
    """
    for i in range(obstacles.side_start[k], obstacles.side_start[k + 1]):
        nx, ny, within = obstacles.side[i, 2], obstacles.side[i, 3], obstacles.side[i, 4] + MARGIN_M
        if min(nx * x + ny * y, nx * to_x + ny * to_y) > within:
            return True
    return False


@kernel()
def length_below_m(length_m: float, z: float, to_z: float, top_m: Any):
    """Return the length over the floor of the part below a top higher than z, of a line that rises from z to to_z."""
    return length_m if top_m >= to_z else length_m * ((top_m - z) / (to_z - z))


@kernel()
def obstacle_between(
    obstacles: ObstacleIndex, arena: int, x: float, y: float, z: float, to_x: float, to_y: float, to_z: float
):
    """Return True if an obstacle touches the line from (x, y, z) to (to_x, to_y, to_z) below its top; all in m."""
    if to_z < z:  # from the lower end
        x, y, z, to_x, to_y, to_z = to_x, to_y, to_z, x, y, z
    dx, dy = to_x - x, to_y - y
    distance_m = np.sqrt(dx * dx + dy * dy)
    if distance_m == 0.0:
        return False
    dx, dy, cells = dx / distance_m, dy / distance_m, obstacles.cells
    first, last = columns_to_obstacles(obstacles, arena, x, y, to_x, to_y)
    for column in range(first, last + 1):
        low, high = rows_to_obstacles(obstacles, arena, column, x, y, to_x, to_y)
        for row in range(low, high + 1):
            c = cell_number(cells, arena, column, row)
            for at in range(cells.start[c], cells.start[c + 1]):
                k = cells.item[at]
                top_m = obstacles.shape[k, 3]
                if top_m <= z or is_beside(x, y, to_x, to_y, obstacles, k):
                    continue
                if ray_to_obstacle(x, y, dx, dy, obstacles, k) <= length_below_m(distance_m, z, to_z, top_m):
                    return True
    return False


@kernel(from_python=True)
def is_blocked(
    obstacles: ObstacleIndex,
    arena: int,
    x0: Any,
    y0: Any,
    z0: Any,
    x1: Any,
    y1: Any,
    z1: Any,
    wrap_x: float,
    wrap_y: float,
):
    """Return True if an obstacle of the arena touches the shortest line between two points below its top.

    Nothing is between two points one above the other. `obstacles` is an obstacle index without images, `wrap_x` and
    `wrap_y` are the sides of a torus in m; 0: the arena ends there. A line over the edge is tested on both sides.
    """
    over_x, over_y = to_nearest(x1 - x0, wrap_x), to_nearest(y1 - y0, wrap_y)
    x1, y1 = x1 + over_x, y1 + over_y
    for i in range(2 if over_x != 0.0 else 1):
        for j in range(2 if over_y != 0.0 else 1):
            back_x, back_y = i * over_x, j * over_y
            if obstacle_between(obstacles, arena, x0 - back_x, y0 - back_y, z0, x1 - back_x, y1 - back_y, z1):
                return True
    return False
