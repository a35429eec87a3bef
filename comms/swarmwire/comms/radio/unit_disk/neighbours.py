"""Neighbours in range: the links of a unit disk, found with the robot index.

Arenas have walls or wrap around (torus); on a torus the shortest distance counts.
"""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.base.geometry import robot_index
from swarmwire.comms.base.geometry.obstacles import to_nearest
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.radio.transmissions import FATE, SENDER, TO
from swarmwire.comms.robot.packets import Fate

# Cells in a row that cover the range on a torus: the last cell at a seam may be cut, so that two cells count as one.
CELLS = 5
TOO_LARGE = int(Fate.TOO_LARGE)


class Neighbours(NamedTuple):
    """Robots in range of each robot row r: other[first[r]:first[r + 1]], in grid order."""

    first: IntArray  # (rows + 1,)
    other: IntArray  # robot rows


def neighbours_of(pose: FloatArray, running: BoolArray, size_m: tuple[float, float], range_m: float) -> Neighbours:
    """Robots within `range_m` of each other in the same arena, centre to centre, alive or not.

    Arenas that are not `running` (arenas,) have none.
    """
    x, y = np.ascontiguousarray(pose[:, 0]), np.ascontiguousarray(pose[:, 1])
    return Neighbours(*_within(x, y, running, size_m, range_m))


@njit()
def links_in_range(first: IntArray, other: IntArray, robots: int, packets: IntArray) -> tuple[IntArray, IntArray]:
    """Packet row and robot row for each robot in range of a packet's sender, packet by packet.

    `first` and `other` are those of `Neighbours`; `packets` is a table of transmissions. Those that are TOO_LARGE have
    no links.
    """
    sender, to, fate = packets[SENDER], packets[TO], packets[FATE]
    capacity = 0
    for s in sender:
        capacity += first[s + 1] - first[s]
    packet, receiver = np.empty(capacity, np.int64), np.empty(capacity, np.int64)
    count = 0
    for p in range(len(sender)):
        s = sender[p]
        for k in range(first[s], first[s + 1]):
            packet[count], receiver[count] = p, other[k]
            is_addressed = to[p] == BROADCAST or other[k] == s - s % robots + to[p]
            count += is_addressed and fate[p] != TOO_LARGE
    return packet[:count], receiver[:count]


@njit()
def pairs_in_range(neighbours: Neighbours, alive: BoolArray) -> IntArray:
    """Robot rows a < b of all pairs that are alive and in range of each other, sorted, (e, 2)."""
    first, other = neighbours.first, neighbours.other.view(np.uint64)
    pair = np.empty((len(other) + 1, 2), np.int64)
    count = 0
    for a in range(len(alive)):
        first_of_a = count
        for k in range(np.uint64(first[a]), np.uint64(first[a + 1] if alive[a] else first[a])):
            b = other[k]
            pair[np.uint64(count), 0], pair[np.uint64(count), 1] = a, b
            count += (b > np.uint64(a)) & alive[b]
        _sort(pair[first_of_a:count, 1])
    return pair[:count]


@njit()
def _sort(values):
    for k in range(1, len(values)):
        value, place = values[k], k
        while place > 0 and values[place - 1] > value:
            values[place] = values[place - 1]
            place -= 1
        values[place] = value


@njit()
def _within(x, y, running, size_m, range_m):
    cells = robot_index.build(x, y, size_m, range_m * robot_index.SLACK, running)
    # In grid order, so that the strips around a robot are read sequentially.
    order, sorted_x, sorted_y = cells.order.view(np.uint64), x[cells.order], y[cells.order]
    begin, stop = _strips(x, y, len(x) // len(running), cells)
    first, other = np.zeros(len(x) + 1, np.int64), np.empty((stop - begin).sum(), np.uint64)
    count, square_m2 = 0, range_m * range_m
    for s in range(len(x)):
        x_s, y_s, self_row = x[s], y[s], np.uint64(s)
        for j in range(3):
            for k in range(np.uint64(begin[s, j]), np.uint64(stop[s, j])):
                dx, dy, r = sorted_x[k] - x_s, sorted_y[k] - y_s, order[k]
                # Branchless: write first, then advance if it counts; a third of branches would be mispredicted.
                other[np.uint64(count)] = r
                count += (r != self_row) & (dx * dx + dy * dy <= square_m2)
        first[s + 1] = count
    return first, other[:count].view(np.int64)


@njit()
def _strips(x, y, robots, cells):
    """Strips of cells below, at and above each robot row: first and stop in grid order, (rows, 3) each."""
    first, stop = np.zeros((len(x), 3), np.int64), np.zeros((len(x), 3), np.int64)
    nx, ny, start = cells.nx, cells.ny, cells.start  # unpacked once: tuple access costs as much as the rest
    for row in range(len(x)):
        if robot_index.is_empty(cells, row // robots):
            continue
        i = robot_index.cell_of(x[row], cells.left_m, cells.cell_m, nx)
        j = robot_index.cell_of(y[row], cells.bottom_m, cells.cell_m, ny)
        for cell_row in range(max(j - 1, 0), min(j + 2, ny)):
            left = ((row // robots) * ny + cell_row) * nx
            strip = cell_row - j + 1
            first[row, strip], stop[row, strip] = start[left + max(i - 1, 0)], start[left + min(i + 1, nx - 1) + 1]
    return first, stop


def neighbours_on_torus(
    pose: FloatArray, running: BoolArray, size_m: tuple[float, float], range_m: float
) -> Neighbours:
    """As `neighbours_of`, where opposite sides of each arena meet: shortest distances count."""
    x, y = np.ascontiguousarray(pose[:, 0]), np.ascontiguousarray(pose[:, 1])
    cells = robot_index.build(x, y, size_m, range_m * robot_index.SLACK, running)
    return Neighbours(*_within_torus(x, y, len(x) // len(running), cells, size_m, range_m))


@njit()
def _within_torus(x, y, robots, cells, size_m, range_m):
    capacity = 0
    for s in range(len(x)):
        capacity += _near(cells, x, y, robots, s, np.empty(0, np.int64))
    first, other = np.zeros(len(x) + 1, np.int64), np.empty(capacity, np.int64)
    neighbours = np.empty(robots, np.int64)
    count = 0
    for s in range(len(x)):
        for k in range(_near(cells, x, y, robots, s, neighbours)):
            r = neighbours[k]
            dx, dy = x[r] - x[s], y[r] - y[s]
            dx, dy = dx + to_nearest(dx, size_m[0]), dy + to_nearest(dy, size_m[1])
            other[count] = r
            count += (r != s) & (dx * dx + dy * dy <= range_m * range_m)
        first[s + 1] = count
    return first, other[:count].copy()


@njit()
def _near(cells, x, y, robots, s, neighbours):
    """Number of robots in the cells around robot s, including s; stored in `neighbours` unless that is empty."""
    if robot_index.is_empty(cells, s // robots):
        return 0
    i, columns = _first_of(robot_index.cell_of(x[s], cells.left_m, cells.cell_m, cells.nx), cells.nx)
    j, rows = _first_of(robot_index.cell_of(y[s], cells.bottom_m, cells.cell_m, cells.ny), cells.ny)
    count = 0
    for row in range(j, j + rows):
        for column in range(i, i + columns):
            cell = ((s // robots) * cells.ny + row % cells.ny) * cells.nx + column % cells.nx
            for k in range(cells.start[cell], cells.start[cell + 1]):
                if len(neighbours):
                    neighbours[count] = cells.order[k]
                count += 1
    return count


@njit()
def _first_of(cell, cells):
    """First cell to search along one axis, and the number of cells; none twice."""
    return (cell - CELLS // 2, CELLS) if cells >= CELLS else (0, cells)
