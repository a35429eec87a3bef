"""A uniform grid over the robots of every arena, so that kernels look at near robots only. Compiled."""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np
from numba import njit

from swarmwire.comms.arrays import BoolArray, IntArray

MOST_CELLS_PER_SIDE = 512  # in each arena


class Grid(NamedTuple):
    """Robots by cell. Cell (i, j) of arena a is c = (a * ny + j) * nx + i; its robots are order[start[c]:start[c + 1]].

    A robot outside the arena counts to the nearest border cell, so two robots nearer than `cell_m` are always in
    the same or in neighbouring cells.
    """

    cell_m: float
    nx: int
    ny: int
    left_m: float
    bottom_m: float
    start: IntArray  # (arenas * ny * nx + 1,)
    order: IntArray  # robot rows, rising within a cell


def build(x, y, arenas: int, size_m: tuple[float, float], reach_m: float, running: BoolArray | None = None) -> Grid:
    """The grid of robots at x, y (rows,), in which all within `reach_m` of a robot lie in the 3 x 3 cells around it.

    Where `running` (arenas,) is False, the cells of the arena are empty; None: no arena is left out.
    """
    cell_m = max(reach_m, max(size_m) / MOST_CELLS_PER_SIDE)
    nx, ny = max(int(np.ceil(size_m[0] / cell_m)), 1), max(int(np.ceil(size_m[1] / cell_m)), 1)
    left_m, bottom_m = -0.5 * size_m[0], -0.5 * size_m[1]
    present = np.ones(arenas, np.bool_) if running is None else running
    start, order = _sort(x, y, present, cell_m, nx, ny, left_m, bottom_m)
    return Grid(cell_m, nx, ny, left_m, bottom_m, start, order)


@njit(cache=True)
def cell_of(at_m, origin_m, cell_m, cells):
    """The cell index along one axis of a coordinate in m."""
    return min(max(int(np.floor((at_m - origin_m) / cell_m)), 0), cells - 1)


@njit(cache=True)
def is_empty(cells, arena):
    """Whether no robot of an arena is in the grid."""
    per_arena = cells.nx * cells.ny
    return cells.start[arena * per_arena] == cells.start[(arena + 1) * per_arena]


@njit(cache=True)
def _sort(x, y, present, cell_m, nx, ny, left_m, bottom_m):
    rows, arenas = len(x), len(present)
    robots = rows // arenas
    cell = np.empty(rows, np.int64)
    start = np.zeros(arenas * nx * ny + 1, np.int64)
    for arena in range(arenas):
        for row in range(arena * robots, (arena + present[arena]) * robots):
            i, j = cell_of(x[row], left_m, cell_m, nx), cell_of(y[row], bottom_m, cell_m, ny)
            cell[row] = (arena * ny + j) * nx + i
            start[cell[row] + 1] += 1
    for c in range(len(start) - 1):
        start[c + 1] += start[c]
    filled = start[:-1].copy()
    order = np.empty(start[-1], np.int64)
    for arena in range(arenas):
        for row in range(arena * robots, (arena + present[arena]) * robots):
            order[filled[cell[row]]] = row
            filled[cell[row]] += 1
    return start, order
