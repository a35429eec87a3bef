"""Which robots are in reach on a torus: as `reach`, with the shortest distances."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np
from numba import njit

from swarmwire.comms.air.disk.reach import CELL_SLACK, Reach
from swarmwire.comms.arrays import BoolArray, FloatArray
from swarmwire.comms.geometry import grid
from swarmwire.comms.geometry.obstacles import to_nearest

CELLS = 5  # in a row that hold all within reach: the last cell at a seam may be cut, and then two do what one would


def reach_on_torus(pose: FloatArray, running: BoolArray, size_m: tuple[float, float], range_m: float) -> Reach:
    """As `reach.reach`, where opposite sides of each arena meet."""
    x, y = np.ascontiguousarray(pose[:, 0]), np.ascontiguousarray(pose[:, 1])
    cells = grid.build(x, y, len(running), size_m, range_m * CELL_SLACK, running)
    return Reach(*_within(x, y, len(x) // len(running), cells, size_m, range_m))


@njit(cache=True)
def _within(x, y, robots, cells, size_m, range_m):
    most = 0
    for s in range(len(x)):
        most += _near(cells, x, y, robots, s, np.empty(0, np.int64))
    first, other = np.zeros(len(x) + 1, np.int64), np.empty(most, np.int64)
    near = np.empty(robots, np.int64)
    found = 0
    for s in range(len(x)):
        for k in range(_near(cells, x, y, robots, s, near)):
            r = near[k]
            dx, dy = x[r] - x[s], y[r] - y[s]
            dx, dy = dx + to_nearest(dx, size_m[0]), dy + to_nearest(dy, size_m[1])
            other[found] = r
            found += (r != s) & (dx * dx + dy * dy <= range_m * range_m)
        first[s + 1] = found
    return first, other[:found].copy()


@njit(cache=True)
def _near(cells, x, y, robots, s, near):
    """How many robots are in the cells around robot s, itself among them; put into `near` if there is room."""
    if grid.is_empty(cells, s // robots):
        return 0
    i, columns = _first_of(grid.cell_of(x[s], cells.left_m, cells.cell_m, cells.nx), cells.nx)
    j, rows = _first_of(grid.cell_of(y[s], cells.bottom_m, cells.cell_m, cells.ny), cells.ny)
    count = 0
    for row in range(j, j + rows):
        for column in range(i, i + columns):
            cell = ((s // robots) * cells.ny + row % cells.ny) * cells.nx + column % cells.nx
            for k in range(cells.start[cell], cells.start[cell + 1]):
                if len(near):
                    near[count] = cells.order[k]
                count += 1
    return count


@njit(cache=True)
def _first_of(cell, cells):
    """The first of the cells to look at along one axis, and how many; none twice."""
    return (cell - CELLS // 2, CELLS) if cells >= CELLS else (0, cells)
