"""Which robots a packet might reach: the links of a disk, found on a grid."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np
from numba import njit

from swarmwire.comms import grid
from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.packets import BROADCAST

# Two robots exactly `range_m` apart must not fall two cells apart by rounding.
CELL_SLACK = 1.0 + 1e-9


def links_in_range(
    pose: FloatArray,
    alive: BoolArray,
    arenas: int,
    size_m: tuple[float, float],
    range_m: float,
    sender: IntArray,
    to: IntArray,
) -> tuple[IntArray, IntArray]:
    """The row of each packet and the robot row of each live robot within `range_m` of its sender, centre to centre.

    `sender` (k,) are robot rows, `to` (k,) the index in the arena of the one receiver, or BROADCAST.
    Packets come in their order; the receivers of one in the order of the grid.
    """
    x, y = np.ascontiguousarray(pose[:, 0]), np.ascontiguousarray(pose[:, 1])
    cells = grid.build(x, y, arenas, size_m, range_m * CELL_SLACK)
    return _within(x, y, alive, len(x) // arenas, cells, range_m, sender, to)


@njit(cache=True)
def _within(x, y, alive, robots, cells, range_m, sender, to):
    most = 0
    for p in range(len(sender)):
        for j in range(-1, 2):
            first, stop = strip(x[sender[p]], y[sender[p]], sender[p] // robots, cells, j)
            most += stop - first
    packet, receiver = np.empty(most, np.int64), np.empty(most, np.int64)
    found = 0
    for p in range(len(sender)):
        s = sender[p]
        if to[p] != BROADCAST:
            r = s - s % robots + to[p]
            packet[found], receiver[found] = p, r
            found += _joined(x, y, alive, range_m, s, r)
            continue
        for j in range(-1, 2):
            first, stop = strip(x[s], y[s], s // robots, cells, j)
            for k in range(first, stop):
                r = cells.order[k]
                # Written first and kept if it counts: a branch would be guessed wrong a third of the time.
                packet[found], receiver[found] = p, r
                found += _joined(x, y, alive, range_m, s, r)
    return packet[:found].copy(), receiver[:found].copy()


@njit(cache=True)
def strip(x, y, arena, cells, row):
    """First and stop in the grid's order of the three cells side by side that are `row` rows above (x, y) in m.

    `cells` is a `grid.Grid`; what lies beyond its edge is empty.
    """
    i = grid.cell_of(x, cells.left_m, cells.cell_m, cells.nx)
    j = grid.cell_of(y, cells.bottom_m, cells.cell_m, cells.ny) + row
    if j < 0 or j >= cells.ny:
        return 0, 0
    left = (arena * cells.ny + j) * cells.nx
    return cells.start[left + max(i - 1, 0)], cells.start[left + min(i + 1, cells.nx - 1) + 1]


@njit(cache=True)
def _joined(x, y, alive, range_m, s, r):
    dx, dy = x[r] - x[s], y[r] - y[s]
    return (r != s) & alive[r] & (dx * dx + dy * dy <= range_m * range_m)
