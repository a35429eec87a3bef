"""The spatial index of robots: a uniform grid over the arenas, so that kernels read near robots only. Compiled.

Coordinates outside the arena wrap: cell (i, j) also stands for (i + k nx, j + l ny). Robots that leave an open arena
then spread over all cells, and a torus needs no other index. In a grid that `clamps` they count to the nearest border
cell, so that the cells near a robot are one run of each row; no torus can use it. Distances must still be compared.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, IntArray
from swarmwire.comms.base.kernels import kernel, njit

MAX_CELLS_PER_SIDE = 512
SLACK = 1.0 + 1e-9  # rounding may separate two objects at just the reach


class Grid(NamedTuple):
    """Items by cell. Cell (i, j) of arena a is c = (a ny + j) nx + i; its items are item[start[c]:start[c + 1]]."""

    nx: int
    ny: int
    per_x: float  # cells in 1 m
    per_y: float
    zero_x: float  # column of x = 0, not rounded
    zero_y: float
    clamps: bool
    start: IntArray  # (arenas * ny * nx + 1,)
    item: IntArray  # (items,)


def grid_over(size_m: tuple[float, float], cell_m: float, arenas: int, items: int, clamps: bool = False) -> Grid:
    """Return an empty grid for `items` items; items nearer than `cell_m` are in the same or in adjacent cells.

    An integer number of cells spans the arena; in a grid that `clamps` the last cells may reach beyond it.
    """
    nx, per_x, zero_x = _axis(size_m[0], cell_m * SLACK, clamps)
    ny, per_y, zero_y = _axis(size_m[1], cell_m * SLACK, clamps)
    start = np.zeros(arenas * ny * nx + 1, np.int64)
    return Grid(nx, ny, per_x, per_y, zero_x, zero_y, clamps, start, np.zeros(items, np.int64))


def _axis(extent_m: float, cell_m: float, clamps: bool) -> tuple[int, float, float]:
    """Return the number of cells along an axis, that in 1 m, and the index of coordinate 0, not rounded."""
    if clamps:
        cell_m = max(cell_m, extent_m / MAX_CELLS_PER_SIDE)
        return max(math.ceil(extent_m / cell_m), 1), 1.0 / cell_m, 0.5 * extent_m / cell_m
    cells = min(max(int(extent_m / cell_m), 1), MAX_CELLS_PER_SIDE)
    return cells, cells / extent_m, 0.5 * cells


@kernel(from_python=True)
def column_of(grid: Grid, x: float):
    """Return the column of the coordinate x, 0 to nx - 1."""
    return _index_in(int(np.floor(x * grid.per_x + grid.zero_x)), grid.nx, grid.clamps)


@kernel(from_python=True)
def row_of(grid: Grid, y: float):
    """Return the row of the coordinate y, 0 to ny - 1."""
    return _index_in(int(np.floor(y * grid.per_y + grid.zero_y)), grid.ny, grid.clamps)


@kernel()
def _index_in(index: int, cells: int, clamps: Any):
    if 0 <= index < cells:
        return index
    return min(max(index, 0), cells - 1) if clamps else index % cells


@kernel(from_python=True)
def cells_around(cells: AnyArray, grid: Grid, arena: int, x: float, y: float):
    """Write the cell of x, y and the adjacent ones, none twice, to `cells` (9,); return their number."""
    column, row, count = column_of(grid, x), row_of(grid, y), 0
    for j in range(min(grid.ny, 3)):
        first = (arena * grid.ny + (row + j - 1) % grid.ny) * grid.nx
        for i in range(min(grid.nx, 3)):
            cells[count] = first + (column + i - 1) % grid.nx
            count += 1
    return count


@kernel(from_python=True)
def runs_near(runs: Any, grid: Grid, arena: int, x: float, y: float):
    """Write the runs of items in the cell of x, y and in adjacent cells to `runs` (6, 2); return their number.

    A run is its first index in `grid.item` and the one after its last. No item comes twice.
    """
    count = 0
    low, high = _adjacent(row_of(grid, y), grid.ny, grid.clamps)
    left, right = _adjacent(column_of(grid, x), grid.nx, grid.clamps)
    for row in range(low, high + 1):
        first = (arena * grid.ny + _index_in(row, grid.ny, False)) * grid.nx
        if left < 0:
            count = _add_run(runs, count, grid.start, first + grid.nx - 1, first + grid.nx - 1)
        count = _add_run(runs, count, grid.start, first + max(left, 0), first + min(right, grid.nx - 1))
        if right >= grid.nx:
            count = _add_run(runs, count, grid.start, first, first)
    return count


@kernel()
def _adjacent(index: int, cells: int, clamps: Any):
    """Return the first and last of the adjacent columns or rows, not wrapped; none comes twice."""
    if clamps:
        return max(index - 1, 0), min(index + 1, cells - 1)
    return (index - 1, index + 1) if cells >= 3 else (0, cells - 1)


@kernel()
def _add_run(runs: AnyArray, count: int, start: AnyArray, first: int, last: Any):
    runs[count, 0], runs[count, 1] = start[first], start[last + 1]
    return count + 1


@kernel(from_python=True)
def run_near(grid: Grid, arena: int, x: float, y: float, row_offset: Any):
    """Return the run of the three adjacent cells `row_offset` rows above x, y; empty beyond the edge.

    For a grid that clamps.
    """
    row, (left, right) = row_of(grid, y) + row_offset, _adjacent(column_of(grid, x), grid.nx, True)
    if row < 0 or row >= grid.ny:
        return 0, 0
    first = (arena * grid.ny + row) * grid.nx
    return grid.start[first + left], grid.start[first + right + 1]


@kernel(from_python=True)
def sort(grid: Grid, state: AnyArray, running: AnyArray):
    """List robots at x, y = state[arena, robot, :2] in their cells, rising; only of arenas that are `running`."""
    start, item = grid.start, grid.item
    start[:] = 0
    for arena in range(state.shape[0]):
        if not running[arena]:
            continue
        for i in range(state.shape[1]):
            row, column = row_of(grid, state[arena, i, 1]), column_of(grid, state[arena, i, 0])
            start[(arena * grid.ny + row) * grid.nx + column] += 1
    for c in range(1, len(start)):
        start[c] += start[c - 1]
    for arena in range(state.shape[0] - 1, -1, -1):
        if not running[arena]:
            continue
        for i in range(state.shape[1] - 1, -1, -1):
            row, column = row_of(grid, state[arena, i, 1]), column_of(grid, state[arena, i, 0])
            c = (arena * grid.ny + row) * grid.nx + column
            start[c] -= 1
            item[start[c]] = i


@njit()
def rows_in_order(grid: Grid, arenas: int, robots: int) -> IntArray:
    """Return the robot rows in grid order, after `sort`."""
    rows, cells = np.empty(grid.start[-1], np.int64), grid.nx * grid.ny
    for arena in range(arenas):
        for k in range(grid.start[arena * cells], grid.start[(arena + 1) * cells]):
            rows[k] = arena * robots + grid.item[k]
    return rows
