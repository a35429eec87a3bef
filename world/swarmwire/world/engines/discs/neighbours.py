"""Neighbour lists (Verlet lists) of the discs engine: the things that a robot may touch soon. Compiled.

Things are listed with a margin, and anew once a robot has moved by that margin. The motion does not depend on the
margin: contacts are found among the listed things by their present distance, in an order that the lists keep: pairs by
the lower and then by the higher row, fixed things by row. `ObstacleCells` is a grid over each arena, made once, so that
robots test near obstacles only.

L. Verlet (1967), Computer "experiments" on classical fluids, Phys. Rev. 159, 98.
"""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np

from swarmwire.comms.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.comms.geometry.obstacles import Obstacles
from swarmwire.comms.geometry.robot_index import build, cell_of
from swarmwire.comms.kernels import kernel, njit
from swarmwire.world.engines.discs.contacts import BOTTOM, CIRCLE, LEFT, POLYGON, RIGHT, TOP, gap_to_fixed, gap_to_wall

CELLS_PER_OBSTACLE = 4
MAX_CELLS_PER_SIDE = 256


class ObstacleCells(NamedTuple):
    """Obstacles by cell: the cell of a place lists all obstacles within `reach_m` of that place.

    Cell (i, j) of arena a is c = (a * per_side + j) * per_side + i, its obstacles are which[start[c]:start[c + 1]],
    rising: circles by number, then polygons by number after all circles.
    """

    per_side: int
    reach_m: float
    start: IntArray
    which: IntArray


def obstacle_cells(obstacles: Obstacles, size_m: tuple[float, float], reach_m: float) -> ObstacleCells:
    """The cells of every arena."""
    arenas = len(obstacles.circle_start) - 1
    max_obstacles = int((np.diff(obstacles.circle_start) + np.diff(obstacles.polygon_start)).max(initial=0))
    per_side = min(max(int(np.ceil(np.sqrt(CELLS_PER_OBSTACLE * max_obstacles))), 1), MAX_CELLS_PER_SIDE)
    start = np.zeros(arenas * per_side * per_side + 1, np.int64)
    _fill(obstacles, size_m, per_side, reach_m, start, np.empty(0, np.int64))
    np.cumsum(start, out=start)
    which = np.empty(start[-1], np.int64)
    _fill(obstacles, size_m, per_side, reach_m, start[:-1].copy(), which)
    return ObstacleCells(per_side, reach_m, start, which)


@njit()
def _fill(obstacles, size_m, per_side, reach_m, at, which):
    """Put each obstacle at at[c] in `which` for each cell c near it; if there is no room, count them in at[c + 1]."""
    circles = len(obstacles.circle)
    for arena in range(len(obstacles.circle_start) - 1):
        for k in range(obstacles.circle_start[arena], obstacles.circle_start[arena + 1]):
            x, y, reach = obstacles.circle[k, 0], obstacles.circle[k, 1], obstacles.circle[k, 2] + reach_m
            _put(k, arena, x - reach, x + reach, y - reach, y + reach, size_m, per_side, at, which)
        for k in range(obstacles.polygon_start[arena], obstacles.polygon_start[arena + 1]):
            corners = obstacles.side[obstacles.side_start[k] : obstacles.side_start[k + 1]]
            left, right = corners[:, 0].min() - reach_m, corners[:, 0].max() + reach_m
            bottom, top = corners[:, 1].min() - reach_m, corners[:, 1].max() + reach_m
            _put(circles + k, arena, left, right, bottom, top, size_m, per_side, at, which)


@njit()
def _put(obstacle, arena, left, right, bottom, top, size_m, per_side, at, which):
    width, height = size_m[0] / per_side, size_m[1] / per_side
    first, last = cell_of(left, -0.5 * size_m[0], width, per_side), cell_of(right, -0.5 * size_m[0], width, per_side)
    low, high = cell_of(bottom, -0.5 * size_m[1], height, per_side), cell_of(top, -0.5 * size_m[1], height, per_side)
    for j in range(low, high + 1):
        for i in range(first, last + 1):
            c = (arena * per_side + j) * per_side + i
            if len(which):
                which[at[c]] = obstacle
                at[c] += 1
            else:
                at[c + 1] += 1


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
    grid = build(state[:, 0], state[:, 1], arenas, size_m, max(2.0 * (max_radius_m + margin_m), spacing_m), running)
    pairs = np.empty((2 * rows + 16, 2), np.int64)
    count = _list_pairs(robots, state, per_arena, grid, max_radius_m, margin_m, pairs)
    if count > len(pairs):
        pairs = np.empty((count, 2), np.int64)
        _list_pairs(robots, state, per_arena, grid, max_radius_m, margin_m, pairs)
    return pairs[:count]


def fixed_near(
    robots: AnyArray,
    state: FloatArray,
    running: BoolArray,
    size_m: tuple[float, float],
    walled: bool,
    obstacles: Obstacles,
    cells: ObstacleCells,
    margin_m: float,
) -> IntArray:
    """Fixed things with a gap of up to the margin, (things, 3): row, kind, number of the circle or polygon.

    Obstacles that are no higher than the lower side of a robot are left out, and so are arenas that are not `running`
    (arenas,).
    """
    per_arena = len(state) // (len(obstacles.circle_start) - 1)
    things = np.empty((len(state) + 16, 3), np.int64)
    count = _list_fixed(robots, state, running, per_arena, size_m, walled, obstacles, cells, margin_m, things)
    if count > len(things):
        things = np.empty((count, 3), np.int64)
        _list_fixed(robots, state, running, per_arena, size_m, walled, obstacles, cells, margin_m, things)
    return things[:count]


@kernel(from_python=True)
def _list_pairs(robots, state, per_arena, grid, max_radius_m, margin_m, pairs):
    """Fill `pairs`, and return how many there are, whether there is room for them or not."""
    count = 0
    farthest_m = 2.0 * (max_radius_m + margin_m)
    for row in range(len(state)):
        x, y = state[row, 0], state[row, 1]
        i = cell_of(x, grid.left_m, grid.cell_m, grid.nx)
        j = cell_of(y, grid.bottom_m, grid.cell_m, grid.ny)
        begin = count
        for beside in range(max(j - 1, 0), min(j + 2, grid.ny)):
            c = ((row // per_arena) * grid.ny + beside) * grid.nx
            for k in range(grid.start[c + max(i - 1, 0)], grid.start[c + min(i + 2, grid.nx)]):
                other = grid.order[k]
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
    width_m, height_m = size_m[0] / cells.per_side, size_m[1] / cells.per_side
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
        i = cell_of(x, -half_size_m[0], width_m, cells.per_side)
        j = cell_of(y, -half_size_m[1], height_m, cells.per_side)
        c = ((row // per_arena) * cells.per_side + j) * cells.per_side + i
        for k in range(cells.start[c], cells.start[c + 1]):
            kind, which, top_m = _obstacle(obstacles, cells.which[k])
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
