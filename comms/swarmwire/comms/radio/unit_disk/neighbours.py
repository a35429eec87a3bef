"""Neighbours in range: the links of a unit disk, found with the robot index.

Distances are in space; on a torus the shortest one counts.
"""

from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.comms.base.geometry import robot_index
from swarmwire.comms.base.geometry.obstacles import to_nearest
from swarmwire.comms.base.geometry.robot_index import Grid
from swarmwire.comms.base.kernels import kernel, njit


class Neighbours(NamedTuple):
    """Robots in range of each robot row r: other[first[r]:first[r + 1]], in grid order."""

    first: IntArray  # (rows + 1,)
    other: IntArray  # robot rows


def find_neighbours(
    grid: Grid, pose: FloatArray, running: BoolArray, wrap_m: tuple[float, float], range_m: float
) -> Neighbours:
    """Return the robots within `range_m` of each other in the same arena, centre to centre, alive or dead.

    Arenas that are not `running` (arenas,) have none.

    Args:
        grid: a buffer, with cells of at least `range_m`.
        pose: (rows, 4) x, y in m, heading, height in m.
        running: (arenas,).
        wrap_m: sides of a torus, where the shortest distances count, in m; 0 where arenas have walls.
        range_m: of the radio.
    """
    return Neighbours(*_within(grid, pose.reshape(len(running), -1, pose.shape[1]), running, wrap_m, range_m))


@njit()
def pairs_in_range(neighbours: Neighbours, alive: BoolArray) -> IntArray:
    """Return the robot rows a < b of all pairs that are alive and in range of each other, sorted, (e, 2)."""
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
def _sort(values: AnyArray):
    for k in range(1, len(values)):
        value, i = values[k], k
        while i > 0 and values[i - 1] > value:
            values[i] = values[i - 1]
            i -= 1
        values[i] = value


@njit()
def _within(grid: Any, pose: AnyArray, running: Any, wrap_m: tuple[float, float], range_m: float):
    arenas, robots = pose.shape[0], pose.shape[1]
    rows, wraps, square_m2 = arenas * robots, wrap_m[0] > 0.0, range_m * range_m
    robot_index.sort(grid, pose, running)
    # In grid order, so that the runs of robots near a robot are read sequentially.
    order, x, y, z = np.empty(rows, np.uint64), np.empty(rows), np.empty(rows), np.empty(rows)
    runs, run_count = np.empty((rows, 6, 2), np.uint64), np.zeros(rows, np.int64)
    capacity = _near(order, x, y, z, runs, run_count, grid, pose, running)
    first, other = np.zeros(rows + 1, np.int64), np.empty(capacity, np.uint64)
    count = 0
    for arena in range(arenas):
        for i in range(robots):
            row = arena * robots + i
            x_row, y_row, z_row, self_row = pose[arena, i, 0], pose[arena, i, 1], pose[arena, i, 3], np.uint64(row)
            for run in range(run_count[row]):
                for k in range(runs[row, run, 0], runs[row, run, 1]):
                    dx, dy, dz, r = x[k] - x_row, y[k] - y_row, z[k] - z_row, order[k]
                    if wraps:
                        dx, dy = dx + to_nearest(dx, wrap_m[0]), dy + to_nearest(dy, wrap_m[1])
                    # Branchless: write first, then advance if it counts; a third of branches would be mispredicted.
                    other[np.uint64(count)] = r
                    count += (r != self_row) & (dx * dx + dy * dy + dz * dz <= square_m2)
            first[row + 1] = count
    return first, other[:count].view(np.int64)


@kernel()
def _near(
    order: AnyArray,
    x: AnyArray,
    y: AnyArray,
    z: AnyArray,
    runs: AnyArray,
    run_count: AnyArray,
    grid: Any,
    pose: AnyArray,
    running: AnyArray,
):
    """Write rows and coordinates in grid order, and the runs near each row; return the number of robots in all runs."""
    cells, robots, near = grid.nx * grid.ny, pose.shape[1], 0
    for arena in range(len(running)):
        for k in range(grid.start[arena * cells], grid.start[(arena + 1) * cells]):
            i = grid.item[k]
            row = arena * robots + i
            order[k], x[k], y[k], z[k] = row, pose[arena, i, 0], pose[arena, i, 1], pose[arena, i, 3]
            run_count[row] = robot_index.runs_near(runs[row], grid, arena, x[k], y[k])
            for run in range(run_count[row]):
                near += np.int64(runs[row, run, 1] - runs[row, run, 0])
    return near
