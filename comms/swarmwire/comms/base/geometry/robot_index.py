"""Spatial indexes of robots: uniform grids over the arenas, so that kernels read near robots only. Compiled.

`Cells` wraps positions: cell (i, j) stands for all places (i + k nx, j + l ny). So robots that leave an open arena
spread over all cells too, and a torus needs no other index. Sensors, engines and placement use it. `Grid` clamps
positions outside the arena to the border cells. The radio keeps it, since the order of its links decides the order in
which powers are added, and so their last bits. Positions in a cell must still be compared.
"""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.base.kernels import kernel, njit

MAX_CELLS_PER_SIDE = 512  # in each arena
SLACK = 1.0 + 1e-9  # rounding may separate two objects at just the reach


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


@njit()
def build(x: FloatArray, y: FloatArray, size_m: tuple[float, float], reach_m: float, running: BoolArray) -> Grid:
    """The grid of robots at x, y (rows,); all robots within `reach_m` of a robot lie in the 3 x 3 cells around it.

    Where `running` (arenas,) is False, the cells of the arena are empty.
    """
    cell_m = max(reach_m, max(size_m[0], size_m[1]) / MAX_CELLS_PER_SIDE)
    nx, ny = max(int(np.ceil(size_m[0] / cell_m)), 1), max(int(np.ceil(size_m[1] / cell_m)), 1)
    left_m, bottom_m = -0.5 * size_m[0], -0.5 * size_m[1]
    start, order = _sort(x, y, running, cell_m, nx, ny, left_m, bottom_m)
    return Grid(cell_m, nx, ny, left_m, bottom_m, start, order)


@njit()
def cell_of(at_m, origin_m, cell_m, cells):
    """The cell index along one axis of a coordinate in m."""
    return min(max(int(np.floor((at_m - origin_m) / cell_m)), 0), cells - 1)


@kernel()
def strip(x, y, arena, cells, row):
    """First and stop in grid order of the three adjacent cells `row` rows above (x, y) in m.

    `cells` is a grid of `build`; cells beyond its edge are empty.
    """
    i = cell_of(x, cells.left_m, cells.cell_m, cells.nx)
    j = cell_of(y, cells.bottom_m, cells.cell_m, cells.ny) + row
    if j < 0 or j >= cells.ny:
        return 0, 0
    left = (arena * cells.ny + j) * cells.nx
    return cells.start[left + max(i - 1, 0)], cells.start[left + min(i + 1, cells.nx - 1) + 1]


@njit()
def is_empty(cells, arena):
    """Whether no robot of an arena is in the grid."""
    per_arena = cells.nx * cells.ny
    return cells.start[arena * per_arena] == cells.start[(arena + 1) * per_arena]


@njit()
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


class Cells(NamedTuple):
    """Items by cell. Cell (i, j) of arena a is c = (a ny + j) nx + i; its items are item[start[c]:start[c + 1]]."""

    nx: int
    ny: int
    per_x: float  # cells in 1 m; a whole number of them spans the arena
    per_y: float
    start: IntArray  # (arenas * ny * nx + 1,)
    item: IntArray  # (items,)


def cells_over(size_m: tuple[float, float], cell_m: float, arenas: int, items: int) -> Cells:
    """Empty cells for `items` items, each at least `cell_m` wide: nearer items lie in the 3 x 3 cells around."""
    nx, ny = (min(max(int(extent / (cell_m * SLACK)), 1), MAX_CELLS_PER_SIDE) for extent in size_m)
    start = np.zeros(arenas * ny * nx + 1, np.int64)
    return Cells(nx, ny, nx / size_m[0], ny / size_m[1], start, np.zeros(items, np.int64))


@kernel(from_python=True)
def column_of(cells, x):
    """The column of the coordinate x, 0 to nx - 1."""
    column = int(np.floor(x * cells.per_x + 0.5 * cells.nx))
    return column if 0 <= column < cells.nx else column % cells.nx


@kernel(from_python=True)
def row_of(cells, y):
    """The row of the coordinate y, 0 to ny - 1."""
    row = int(np.floor(y * cells.per_y + 0.5 * cells.ny))
    return row if 0 <= row < cells.ny else row % cells.ny


@kernel(from_python=True)
def cells_around(around, cells, arena, x, y):
    """Write the cells around a place, its own included, into `around` (9,); how many: none comes twice."""
    column, row, count = column_of(cells, x), row_of(cells, y), 0
    for j in range(min(cells.ny, 3)):
        first = (arena * cells.ny + (row + j - 1) % cells.ny) * cells.nx
        for i in range(min(cells.nx, 3)):
            around[count] = first + (column + i - 1) % cells.nx
            count += 1
    return count


@kernel(from_python=True)
def sort(cells, state, running):
    """Put robots at x, y = state[arena, robot, :2] into their cells, rising; only of arenas that are `running`."""
    start, item = cells.start, cells.item
    start[:] = 0
    for arena in range(state.shape[0]):
        if not running[arena]:
            continue
        for i in range(state.shape[1]):
            row, column = row_of(cells, state[arena, i, 1]), column_of(cells, state[arena, i, 0])
            start[(arena * cells.ny + row) * cells.nx + column] += 1
    for c in range(1, len(start)):
        start[c] += start[c - 1]
    for arena in range(state.shape[0] - 1, -1, -1):
        if not running[arena]:
            continue
        for i in range(state.shape[1] - 1, -1, -1):
            row, column = row_of(cells, state[arena, i, 1]), column_of(cells, state[arena, i, 0])
            c = (arena * cells.ny + row) * cells.nx + column
            start[c] -= 1
            item[start[c]] = i
