"""Square cells over the arenas, so that kernels look at what is near only. Compiled.

The plane is rolled up: cell (i, j) stands for all places (i + k nx, j + l ny). So robots that leave an open arena
spread over all cells as well, and a torus needs no cells of its own. Whoever finds something compares its position.
"""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np

from swarmwire.comms.arrays import IntArray
from swarmwire.comms.borrowing import borrowing

MOST_PER_SIDE = 512
SLACK = 1.0 + 1e-9  # two things at just the reach may be rounded apart


class Cells(NamedTuple):
    """What lies in each cell. Cell (i, j) of arena a is c = (a ny + j) nx + i and holds item[start[c]:start[c + 1]]."""

    nx: int
    ny: int
    per_x: float  # cells in 1 m; a whole number of them spans the arena
    per_y: float
    start: IntArray  # (arenas * ny * nx + 1,)
    item: IntArray  # (items,)


def cells_over(size_m: tuple[float, float], cell_m: float, arenas: int, items: int) -> Cells:
    """Cells for so many items, each of at least `cell_m` a side: what is nearer lies in the 3 x 3 around."""
    nx, ny = (min(max(int(extent / (cell_m * SLACK)), 1), MOST_PER_SIDE) for extent in size_m)
    start = np.zeros(arenas * ny * nx + 1, np.int64)
    return Cells(nx, ny, nx / size_m[0], ny / size_m[1], start, np.zeros(items, np.int64))


@borrowing(from_python=True)
def column_of(cells, x):
    """The column of a place, 0 to nx - 1."""
    column = int(np.floor(x * cells.per_x + 0.5 * cells.nx))
    return column if 0 <= column < cells.nx else column % cells.nx


@borrowing(from_python=True)
def row_of(cells, y):
    """The row of a place, 0 to ny - 1."""
    row = int(np.floor(y * cells.per_y + 0.5 * cells.ny))
    return row if 0 <= row < cells.ny else row % cells.ny


@borrowing(from_python=True)
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
