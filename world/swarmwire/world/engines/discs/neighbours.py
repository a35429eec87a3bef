"""Neighbour lists (Verlet lists) of the discs engine: the bodies that a robot may touch soon. Compiled.

Bodies are listed with a margin, and again once a robot has moved by that margin. The motion does not depend on the
margin: contacts are found among the listed bodies by their present distance, in an order that the lists keep: pairs by
the lower and then by the higher row, fixed bodies by row.

L. Verlet (1967), Computer "experiments" on classical fluids, Phys. Rev. 159, 98.
"""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.comms.base.geometry.robot_index import Grid, column_of, grid_over, row_of, runs_near, sort
from swarmwire.comms.base.kernels import kernel
from swarmwire.world.engines.discs.contacts import gap_to_fixed, gap_to_wall
from swarmwire.world.engines.discs.records import BOTTOM, CIRCLE, LEFT, POLYGON, RIGHT, TOP, Fixed


class FixedIndex(NamedTuple):
    """Walls and obstacles by cell."""

    fixed: Fixed
    walled: bool
    circle_top_m: FloatArray  # (circles,) height
    polygon_top_m: FloatArray  # (polygons,) height
    cells: Grid  # obstacles within the greatest radius and margin of each cell


def pairs_near(
    robots: AnyArray,
    state: FloatArray,
    running: BoolArray,
    size_m: tuple[float, float],
    max_radius_m: float,
    margin_m: float,
) -> IntArray:
    """Return the pairs of robots with a gap of up to twice the margin, (pairs, 2): lower row, higher row.

    Args:
        robots: (rows,) ROBOT_RECORD.
        state: (rows, 6) x, y in m first.
        running: (arenas,) arenas whose robots are listed.
        size_m: extents of an arena.
        max_radius_m: the greatest radius.
        margin_m: the margin of each robot.
    """
    rows, arenas = len(state), len(running)
    per_arena = rows // arenas
    # About one robot in each cell, if they are spread evenly.
    spacing_m = float(np.sqrt(size_m[0] * size_m[1] / max(per_arena, 1)))
    cells = grid_over(size_m, max(2.0 * (max_radius_m + margin_m), spacing_m), arenas, rows)
    sort(cells, state.reshape(arenas, per_arena, state.shape[1]), running)
    pairs, runs = np.empty((2 * rows + 16, 2), np.int64), np.empty((6, 2), np.int64)
    count = _list_pairs(robots, state, running, cells, runs, max_radius_m, margin_m, pairs)
    if count > len(pairs):
        pairs = np.empty((count, 2), np.int64)
        _list_pairs(robots, state, running, cells, runs, max_radius_m, margin_m, pairs)
    return pairs[:count]


def fixed_near(robots: AnyArray, state: FloatArray, running: BoolArray, index: FixedIndex, margin_m: float) -> IntArray:
    """Return the fixed bodies with a gap of up to the margin, (pairs, 3): row, kind, number of the circle or polygon.

    Obstacles that are no higher than the lower side of a robot are left out, as are arenas that are not `running`
    (arenas,).
    """
    pairs = np.empty((len(state) + 16, 3), np.int64)
    count = _list_fixed(robots, state, running, index, margin_m, pairs)
    if count > len(pairs):
        pairs = np.empty((count, 3), np.int64)
        _list_fixed(robots, state, running, index, margin_m, pairs)
    return pairs[:count]


@kernel(from_python=True)
def _list_pairs(robots, state, running, cells, runs, max_radius_m, margin_m, pairs):
    """Fill `pairs` as far as there is room, and return the number of pairs."""
    per_arena = len(state) // len(running)
    count = 0
    farthest_m = 2.0 * (max_radius_m + margin_m)
    for row in range(len(state)):
        arena, x, y = row // per_arena, state[row, 0], state[row, 1]
        if not running[arena]:
            continue
        begin = count
        for run in range(runs_near(runs, cells, arena, x, y)):
            for k in range(runs[run, 0], runs[run, 1]):
                other = arena * per_arena + cells.item[k]
                dx, dy = state[other, 0] - x, state[other, 1] - y
                apart2 = dx * dx + dy * dy
                if apart2 > farthest_m * farthest_m or other <= row:
                    continue
                if apart2 <= (robots[row].radius_m + robots[other].radius_m + 2.0 * margin_m) ** 2:
                    if count < len(pairs):
                        _insert(pairs, begin, count, row, other)
                    count += 1
    return count


@kernel()
def _insert(pairs, begin, count, row, other):
    """Insert a pair among those of the same row, pairs[begin:count], in rising order."""
    k = count
    while k > begin and pairs[k - 1, 1] > other:
        pairs[k, 0], pairs[k, 1] = pairs[k - 1, 0], pairs[k - 1, 1]
        k -= 1
    pairs[k, 0], pairs[k, 1] = row, other


@kernel(from_python=True)
def _list_fixed(robots, state, running, index, margin_m, pairs):
    """Fill `pairs` as far as there is room, and return the number of pairs."""
    fixed, cells = index.fixed, index.cells
    per_arena = len(state) // len(running)
    count = 0
    for row in range(len(state)):
        if not running[row // per_arena]:
            continue
        robot, x, y = robots[row], state[row, 0], state[row, 1]
        reach_m = robot.radius_m + margin_m
        near_wall = abs(x) + reach_m >= fixed.half_size_m[0] or abs(y) + reach_m >= fixed.half_size_m[1]
        if index.walled and near_wall:
            for wall in (LEFT, RIGHT, BOTTOM, TOP):
                if gap_to_wall(wall, x, y, robot.radius_m, fixed.half_size_m)[0] <= margin_m:
                    _set_pair(pairs, count, row, wall, 0)
                    count += 1
        c = ((row // per_arena) * cells.ny + row_of(cells, y)) * cells.nx + column_of(cells, x)
        for k in range(cells.start[c], cells.start[c + 1]):
            kind, number, top_m = _obstacle(index, cells.item[k])
            if top_m > robot.bottom_m and gap_to_fixed(kind, number, x, y, robot.radius_m, fixed)[0] <= margin_m:
                _set_pair(pairs, count, row, kind, number)
                count += 1
    return count


@kernel()
def _set_pair(pairs, k, row, kind, number):
    if k < len(pairs):
        pairs[k, 0], pairs[k, 1], pairs[k, 2] = row, kind, number


@kernel()
def _obstacle(index, item):
    """Return the kind of a listed obstacle, its number among its kind, and its height in m."""
    polygon = item - len(index.circle_top_m)
    if polygon < 0:
        return CIRCLE, item, index.circle_top_m[item]
    return POLYGON, polygon, index.polygon_top_m[polygon]
