"""Which robots a packet might reach: the links of a unit disk, found on a grid."""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np
from numba import njit

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.geometry import robot_index
from swarmwire.comms.geometry.obstacles import to_nearest
from swarmwire.comms.kernels import kernel
from swarmwire.comms.packets import BROADCAST

# Two robots exactly `range_m` apart must not fall two cells apart by rounding.
CELL_SLACK = 1.0 + 1e-9


class Reach(NamedTuple):
    """All robots in range of each: those of robot row r are other[first[r]:first[r + 1]], in the order of the grid."""

    first: IntArray  # (rows + 1,)
    other: IntArray  # robot rows


def reach(pose: FloatArray, running: BoolArray, size_m: tuple[float, float], range_m: float) -> Reach:
    """The robots within `range_m` of each other in the same arena, centre to centre, alive or not.

    In arenas that are not `running` (arenas,) nobody is.
    """
    x, y = np.ascontiguousarray(pose[:, 0]), np.ascontiguousarray(pose[:, 1])
    cells = robot_index.build(x, y, len(running), size_m, range_m * CELL_SLACK, running)
    return Reach(*_within(x, y, len(x) // len(running), cells, range_m))


@njit(cache=True)
def links_in_reach(near: Reach, robots: int, sender: IntArray, to: IntArray) -> tuple[IntArray, IntArray]:
    """The row of each packet and the robot row of each robot in range of its sender, packet by packet.

    `sender` (k,) are robot rows, `to` (k,) the index in the arena of the one receiver, or BROADCAST.
    """
    most = 0
    for s in sender:
        most += near.first[s + 1] - near.first[s]
    packet, receiver = np.empty(most, np.int64), np.empty(most, np.int64)
    found = 0
    for p in range(len(sender)):
        s = sender[p]
        for k in range(near.first[s], near.first[s + 1]):
            packet[found], receiver[found] = p, near.other[k]
            found += to[p] == BROADCAST or near.other[k] == s - s % robots + to[p]
    return packet[:found], receiver[:found]


@njit(cache=True)
def pairs_in_reach(near: Reach, alive: BoolArray) -> IntArray:
    """Robot rows a < b of all pairs alive in range of each other, sorted, (e, 2)."""
    first, other = near.first, near.other.view(np.uint64)
    pair = np.empty((len(other) + 1, 2), np.int64)
    found = 0
    for a in range(len(alive)):
        of_a = found
        for k in range(np.uint64(first[a]), np.uint64(first[a + 1] if alive[a] else first[a])):
            b = other[k]
            pair[np.uint64(found), 0], pair[np.uint64(found), 1] = a, b
            found += (b > np.uint64(a)) & alive[b]
        _sort(pair[of_a:found, 1])
    return pair[:found]


@njit(cache=True)
def _sort(few):
    for k in range(1, len(few)):
        moved, place = few[k], k
        while place > 0 and few[place - 1] > moved:
            few[place] = few[place - 1]
            place -= 1
        few[place] = moved


@njit(cache=True)
def _within(x, y, robots, cells, range_m):
    # In the grid's order, so that the strips around a robot are read from end to end.
    order, there_x, there_y = cells.order.view(np.uint64), x[cells.order], y[cells.order]
    begin, stop = _strips(x, y, robots, cells)
    first, other = np.zeros(len(x) + 1, np.int64), np.empty((stop - begin).sum(), np.uint64)
    found, square_m2 = 0, range_m * range_m
    for s in range(len(x)):
        own_x, own_y, own = x[s], y[s], np.uint64(s)
        for j in range(3):
            for k in range(np.uint64(begin[s, j]), np.uint64(stop[s, j])):
                dx, dy, r = there_x[k] - own_x, there_y[k] - own_y, order[k]
                # Written first and kept if it counts: a branch would be guessed wrong a third of the time.
                other[np.uint64(found)] = r
                found += (r != own) & (dx * dx + dy * dy <= square_m2)
        first[s + 1] = found
    return first, other[:found].view(np.int64)


@njit(cache=True)
def _strips(x, y, robots, cells):
    """The strips below, at and above each robot row: first and stop in the grid's order, (rows, 3) each."""
    first, stop = np.zeros((len(x), 3), np.int64), np.zeros((len(x), 3), np.int64)
    nx, ny, start = cells.nx, cells.ny, cells.start  # out of the tuple once, which costs as much as the rest
    for row in range(len(x)):
        if robot_index.is_empty(cells, row // robots):
            continue
        i = robot_index.cell_of(x[row], cells.left_m, cells.cell_m, nx)
        j = robot_index.cell_of(y[row], cells.bottom_m, cells.cell_m, ny)
        for below in range(max(j - 1, 0), min(j + 2, ny)):
            left = ((row // robots) * ny + below) * nx
            strip = below - j + 1
            first[row, strip], stop[row, strip] = start[left + max(i - 1, 0)], start[left + min(i + 1, nx - 1) + 1]
    return first, stop


@kernel()
def strip(x, y, arena, cells, row):
    """First and stop in the grid's order of the three cells side by side that are `row` rows above (x, y) in m.

    `cells` is a `grid.Grid`; what lies beyond its edge is empty.
    """
    i = robot_index.cell_of(x, cells.left_m, cells.cell_m, cells.nx)
    j = robot_index.cell_of(y, cells.bottom_m, cells.cell_m, cells.ny) + row
    if j < 0 or j >= cells.ny:
        return 0, 0
    left = (arena * cells.ny + j) * cells.nx
    return cells.start[left + max(i - 1, 0)], cells.start[left + min(i + 1, cells.nx - 1) + 1]


# --- Which robots are in reach on a torus: as `reach`, with the shortest distances.


CELLS = 5  # in a row that hold all within reach: the last cell at a seam may be cut, and then two do what one would


def reach_on_torus(pose: FloatArray, running: BoolArray, size_m: tuple[float, float], range_m: float) -> Reach:
    """As `reach.reach`, where opposite sides of each arena meet."""
    x, y = np.ascontiguousarray(pose[:, 0]), np.ascontiguousarray(pose[:, 1])
    cells = robot_index.build(x, y, len(running), size_m, range_m * CELL_SLACK, running)
    return Reach(*_within_torus(x, y, len(x) // len(running), cells, size_m, range_m))


@njit(cache=True)
def _within_torus(x, y, robots, cells, size_m, range_m):
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
    if robot_index.is_empty(cells, s // robots):
        return 0
    i, columns = _first_of(robot_index.cell_of(x[s], cells.left_m, cells.cell_m, cells.nx), cells.nx)
    j, rows = _first_of(robot_index.cell_of(y[s], cells.bottom_m, cells.cell_m, cells.ny), cells.ny)
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
