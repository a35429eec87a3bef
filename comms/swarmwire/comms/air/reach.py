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


def pairs_in_range(
    pose: FloatArray, alive: BoolArray, arenas: int, size_m: tuple[float, float], range_m: float
) -> IntArray:
    """Robot rows a < b of all pairs of live robots of an arena within `range_m`, centre to centre, sorted, (e, 2)."""
    x, y = np.ascontiguousarray(pose[:, 0]), np.ascontiguousarray(pose[:, 1])
    cells = grid.build(x, y, arenas, size_m, range_m * CELL_SLACK)
    return _pairs(x, y, alive, len(x) // arenas, cells, range_m)


@njit(cache=True)
def _within(x, y, alive, robots, cells, range_m, sender, to):
    # In the grid's order, so that the strips around a sender are read from end to end.
    order, there_x, there_y, there = cells.order, x[cells.order], y[cells.order], alive[cells.order]
    first, stop = _strips(x, y, robots, cells)
    most, square_m2 = len(sender), range_m * range_m
    for s in sender:
        for j in range(3):
            most += stop[s, j] - first[s, j]
    packet, receiver = np.empty(most, np.int64), np.empty(most, np.int64)
    found = 0
    for p in range(len(sender)):
        s = sender[p]
        own_x, own_y = x[s], y[s]
        if to[p] != BROADCAST:
            r = s - s % robots + to[p]
            dx, dy = x[r] - own_x, y[r] - own_y
            packet[found], receiver[found] = p, r
            found += (r != s) & alive[r] & (dx * dx + dy * dy <= square_m2)
            continue
        for j in range(3):
            for k in range(first[s, j], stop[s, j]):
                dx, dy, r = there_x[k] - own_x, there_y[k] - own_y, order[k]
                # Written first and kept if it counts: a branch would be guessed wrong a third of the time.
                packet[found], receiver[found] = p, r
                found += (r != s) & there[k] & (dx * dx + dy * dy <= square_m2)
    return packet[:found].copy(), receiver[:found].copy()


@njit(cache=True)
def _pairs(x, y, alive, robots, cells, range_m):
    order, there_x, there_y, there = cells.order, x[cells.order], y[cells.order], alive[cells.order]
    first, stop = _strips(x, y, robots, cells)
    pair = np.empty(((stop - first).sum(), 2), np.int64)
    found, square_m2 = 0, range_m * range_m
    for a in range(len(x)):
        own_x, own_y, of_a = x[a], y[a], found
        for j in range(3 if alive[a] else 0):
            for k in range(first[a, j], stop[a, j]):
                dx, dy, b = there_x[k] - own_x, there_y[k] - own_y, order[k]
                pair[found, 0], pair[found, 1] = a, b
                found += (b > a) & there[k] & (dx * dx + dy * dy <= square_m2)
        for k in range(of_a + 1, found):  # a few: sorted by insertion
            b, place = pair[k, 1], k
            while place > of_a and pair[place - 1, 1] > b:
                pair[place, 1] = pair[place - 1, 1]
                place -= 1
            pair[place, 1] = b
    return pair[:found].copy()


@njit(cache=True)
def _strips(x, y, robots, cells):
    """The strips below, at and above each robot row: first and stop, (rows, 3) each."""
    first, stop = np.empty((len(x), 3), np.int64), np.empty((len(x), 3), np.int64)
    for row in range(len(x)):
        for j in range(3):
            first[row, j], stop[row, j] = _strip(x[row], y[row], row // robots, cells, j - 1)
    return first, stop


@njit(cache=True)
def _strip(x, y, arena, cells, row):
    """First and stop in the grid's order of the three cells side by side that are `row` rows above (x, y)."""
    i = grid.cell_of(x, cells.left_m, cells.cell_m, cells.nx)
    j = grid.cell_of(y, cells.bottom_m, cells.cell_m, cells.ny) + row
    if j < 0 or j >= cells.ny:
        return 0, 0
    left = (arena * cells.ny + j) * cells.nx
    return cells.start[left + max(i - 1, 0)], cells.start[left + min(i + 1, cells.nx - 1) + 1]
