"""Neighbour lists (Verlet lists) of the discs engine: the things that a robot may touch soon. Compiled.

Things are listed with a margin, and again once a robot has moved by that margin. The motion does not depend on the
margin: contacts are found among the listed things by their present distance, in an order that the lists keep: pairs by
the lower and then by the higher row, fixed things by row.

L. Verlet (1967), Computer "experiments" on classical fluids, Phys. Rev. 159, 98.
"""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.comms.base.geometry.obstacles import Obstacles
from swarmwire.comms.base.geometry.robot_index import Cells, cells_around, cells_over, column_of, row_of, sort
from swarmwire.comms.base.kernels import kernel
from swarmwire.world.engines.discs.contacts import BOTTOM, CIRCLE, LEFT, POLYGON, RIGHT, TOP, gap_to_fixed, gap_to_wall


def pairs_near(
    robots: AnyArray,
    state: FloatArray,
    running: BoolArray,
    size_m: tuple[float, float],
    max_radius_m: float,
    margin_m: float,
) -> IntArray:
    """Pairs of robots with a gap of up to twice the margin, (pairs, 2): lower row, higher row.

    Args:
        robots: (rows,) ROBOT records.
        state: (rows, 6) x, y in m first.
        running: (arenas,) whose robots move; those of others are not listed.
        size_m: of an arena.
        max_radius_m: the greatest radius.
        margin_m: the margin of each robot.
    """
    rows, arenas = len(state), len(running)
    per_arena = rows // arenas
    # About a robot in each cell, if they are spread evenly.
    spacing_m = float(np.sqrt(size_m[0] * size_m[1] / max(per_arena, 1)))
    cells = cells_over(size_m, max(2.0 * (max_radius_m + margin_m), spacing_m), arenas, rows)
    sort(cells, state.reshape(arenas, per_arena, state.shape[1]), running)
    pairs, around = np.empty((2 * rows + 16, 2), np.int64), np.empty(9, np.int64)
    count = _list_pairs(robots, state, running, per_arena, cells, around, max_radius_m, margin_m, pairs)
    if count > len(pairs):
        pairs = np.empty((count, 2), np.int64)
        _list_pairs(robots, state, running, per_arena, cells, around, max_radius_m, margin_m, pairs)
    return pairs[:count]


def fixed_near(
    robots: AnyArray,
    state: FloatArray,
    running: BoolArray,
    size_m: tuple[float, float],
    walled: bool,
    obstacles: Obstacles,
    cells: Cells,
    margin_m: float,
) -> IntArray:
    """Fixed things with a gap of up to the margin, (things, 3): row, kind, number of the circle or polygon.

    `cells` are those of an index of the obstacles within the greatest radius and margin. Obstacles that are no higher
    than the lower side of a robot are left out, and so are arenas that are not `running` (arenas,).
    """
    per_arena = len(state) // (len(obstacles.circle_start) - 1)
    things = np.empty((len(state) + 16, 3), np.int64)
    count = _list_fixed(robots, state, running, per_arena, size_m, walled, obstacles, cells, margin_m, things)
    if count > len(things):
        things = np.empty((count, 3), np.int64)
        _list_fixed(robots, state, running, per_arena, size_m, walled, obstacles, cells, margin_m, things)
    return things[:count]


@kernel(from_python=True)
def _list_pairs(robots, state, running, per_arena, cells, around, max_radius_m, margin_m, pairs):
    """Fill `pairs`, and return how many there are, whether there is room for them or not."""
    count = 0
    farthest_m = 2.0 * (max_radius_m + margin_m)
    for row in range(len(state)):
        arena, x, y = row // per_arena, state[row, 0], state[row, 1]
        if not running[arena]:
            continue
        begin, at, around_it = count, 0, cells_around(around, cells, arena, x, y)
        while at < around_it:
            first = around[at]
            while at + 1 < around_it and around[at + 1] == around[at] + 1:  # cells side by side are read at once
                at += 1
            at += 1
            for k in range(cells.start[first], cells.start[around[at - 1] + 1]):
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
    place = count
    while place > begin and pairs[place - 1, 1] > other:
        pairs[place, 0], pairs[place, 1] = pairs[place - 1, 0], pairs[place - 1, 1]
        place -= 1
    pairs[place, 0], pairs[place, 1] = row, other


@kernel(from_python=True)
def _list_fixed(robots, state, running, per_arena, size_m, walled, obstacles, cells, margin_m, things):
    """Fill `things`, and return how many there are, whether there is room for them or not."""
    half_size_m = (0.5 * size_m[0], 0.5 * size_m[1])
    count = 0
    for row in range(len(state)):
        if not running[row // per_arena]:
            continue
        robot, x, y = robots[row], state[row, 0], state[row, 1]
        reach_m = robot.radius_m + margin_m
        if walled and (abs(x) + reach_m >= half_size_m[0] or abs(y) + reach_m >= half_size_m[1]):
            for wall in (LEFT, RIGHT, BOTTOM, TOP):
                if gap_to_wall(wall, x, y, robot.radius_m, half_size_m)[0] <= margin_m:
                    _put_near(things, count, row, wall, 0)
                    count += 1
        c = ((row // per_arena) * cells.ny + row_of(cells, y)) * cells.nx + column_of(cells, x)
        for k in range(cells.start[c], cells.start[c + 1]):
            kind, which, top_m = _obstacle(obstacles, cells.item[k])
            if top_m > robot.bottom_m and _gap_m(kind, which, x, y, robot, half_size_m, obstacles) <= margin_m:
                _put_near(things, count, row, kind, which)
                count += 1
    return count


@kernel()
def _put_near(things, place, row, kind, which):
    if place < len(things):
        things[place, 0], things[place, 1], things[place, 2] = row, kind, which


@kernel()
def _obstacle(obstacles, obstacle):
    """The kind of a listed obstacle, its number among its kind, and its height in m."""
    polygon = obstacle - len(obstacles.circle)
    if polygon < 0:
        return CIRCLE, obstacle, obstacles.circle_top_m[obstacle]
    return POLYGON, polygon, obstacles.polygon_top_m[polygon]


@kernel()
def _gap_m(kind, which, x, y, robot, half_size_m, obstacles):
    circle, side_start, side = obstacles.circle, obstacles.side_start, obstacles.side
    return gap_to_fixed(kind, which, x, y, robot.radius_m, half_size_m, circle, side_start, side)[0]
