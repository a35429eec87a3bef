"""Obstacles by cell of a grid over each arena, made once, so that robots look at near obstacles only. Compiled."""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np
from numba import njit

from swarmwire.comms.arrays import IntArray
from swarmwire.comms.geometry.obstacles import Obstacles
from swarmwire.comms.geometry.robot_index import cell_of

CELLS_PER_OBSTACLE = 4
MOST_CELLS_PER_SIDE = 256


class ObstacleCells(NamedTuple):
    """Obstacles near each cell: what is within `reach_m` of a place is listed in the cell of that place.

    Cell (i, j) of arena a is c = (a * per_side + j) * per_side + i, its obstacles are which[start[c]:start[c + 1]],
    rising: circles by number, then polygons by number after all circles.
    """

    per_side: int
    reach_m: float
    start: IntArray
    which: IntArray


def obstacle_cells(obstacles: Obstacles, size_m: tuple[float, float], reach_m: float) -> ObstacleCells:
    """The cells of every arena."""
    arenas = len(obstacles.circle_start) - 1
    most = int((np.diff(obstacles.circle_start) + np.diff(obstacles.polygon_start)).max(initial=0))
    per_side = min(max(int(np.ceil(np.sqrt(CELLS_PER_OBSTACLE * most))), 1), MOST_CELLS_PER_SIDE)
    start = np.zeros(arenas * per_side * per_side + 1, np.int64)
    _fill(obstacles, size_m, per_side, reach_m, start, np.empty(0, np.int64))
    np.cumsum(start, out=start)
    which = np.empty(start[-1], np.int64)
    _fill(obstacles, size_m, per_side, reach_m, start[:-1].copy(), which)
    return ObstacleCells(per_side, reach_m, start, which)


@njit(cache=True)
def _fill(obstacles, size_m, per_side, reach_m, at, which):
    """Put each obstacle at at[c] in `which` for each cell c near it; if there is no room, count them in at[c + 1]."""
    circles = len(obstacles.circle)
    for arena in range(len(obstacles.circle_start) - 1):
        for k in range(obstacles.circle_start[arena], obstacles.circle_start[arena + 1]):
            x, y, reach = obstacles.circle[k, 0], obstacles.circle[k, 1], obstacles.circle[k, 2] + reach_m
            _put(k, arena, x - reach, x + reach, y - reach, y + reach, size_m, per_side, at, which)
        for k in range(obstacles.polygon_start[arena], obstacles.polygon_start[arena + 1]):
            corners = obstacles.side[obstacles.side_start[k] : obstacles.side_start[k + 1]]
            left, right = corners[:, 0].min() - reach_m, corners[:, 0].max() + reach_m
            bottom, top = corners[:, 1].min() - reach_m, corners[:, 1].max() + reach_m
            _put(circles + k, arena, left, right, bottom, top, size_m, per_side, at, which)


@njit(cache=True)
def _put(obstacle, arena, left, right, bottom, top, size_m, per_side, at, which):
    width, height = size_m[0] / per_side, size_m[1] / per_side
    first, last = cell_of(left, -0.5 * size_m[0], width, per_side), cell_of(right, -0.5 * size_m[0], width, per_side)
    low, high = cell_of(bottom, -0.5 * size_m[1], height, per_side), cell_of(top, -0.5 * size_m[1], height, per_side)
    for j in range(low, high + 1):
        for i in range(first, last + 1):
            c = (arena * per_side + j) * per_side + i
            if len(which):
                which[at[c]] = obstacle
                at[c] += 1
            else:
                at[c + 1] += 1
