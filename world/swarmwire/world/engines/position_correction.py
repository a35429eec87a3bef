"""Position correction of the kinematic engine: discs are pushed out of obstacles and walls, overlaps are listed.

Compiled. `push_out` moves a disc out of obstacles and walls by the shortest way, so that it slides along them. It
tests only the obstacles listed for the disc's cell, in their order, with the same result as a test of all obstacles.
`overlaps` lists the robots that overlap. `PositionCorrections` lists the obstacles of all arenas by cell.
"""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.geometry.obstacle_index import obstacles_within
from swarmwire.comms.base.geometry.obstacles import Obstacles
from swarmwire.comms.base.geometry.robot_index import Grid, cells_around, column_of, row_of, sort
from swarmwire.comms.base.kernels import kernel, njit
from swarmwire.world.engines.engine import EngineConfig

MAX_PASSES = 8  # a corner may push a disc back and forth
EPSILON_M = 1e-9  # touching by rounding is no overlap
REACH_GROWTH = 1.25  # spare factor of a greater reach, so that accelerating robots do not cause a sort in each tick


class Discs(NamedTuple):
    """The robots of an arena as discs, (n,) each."""

    radius_m: FloatArray
    bottom_m: FloatArray  # height of the lower side; robots above one another do not overlap
    top_m: FloatArray  # height of the upper side


class PositionCorrection(NamedTuple):
    """The walls and obstacles of all arenas, for kernels."""

    half_x_m: float
    half_y_m: float
    walled: bool
    wraps: bool
    obstacles: Obstacles
    cells: Grid  # obstacles within reach, rising: circle k as k, polygon k as k + circles


@njit()
def shortest(apart_m, half_m, wraps):
    """Return a difference of coordinates; on a torus, that of the nearest images."""
    return apart_m - 2.0 * half_m * np.floor((apart_m + half_m) / (2.0 * half_m)) if wraps else apart_m


@kernel()
def any_near(correction, arena, x, y, reach_m, bottom_m):
    """Return True if the circle around any obstacle taller than `bottom_m` lies within reach of a point.

    The reach is at most that for which the obstacles were listed.
    """
    cells, obstacles, circles = correction.cells, correction.obstacles, len(correction.obstacles.circle)
    c = _cell(cells, arena, x, y)
    for i in range(cells.start[c], cells.start[c + 1]):
        k = cells.item[i]
        if k < circles:
            near = obstacles.circle_top_m[k] > bottom_m and _within(correction, obstacles.circle, k, x, y, reach_m)
        else:
            k -= circles
            near = obstacles.polygon_top_m[k] > bottom_m and _within(correction, obstacles.polygon, k, x, y, reach_m)
        if near:
            return True
    return False


@kernel()
def _cell(cells, arena, x, y):
    return (arena * cells.ny + row_of(cells, y)) * cells.nx + column_of(cells, x)


@kernel()
def _within(correction, circle, k, x, y, reach_m):
    dx = shortest(x - circle[k, 0], correction.half_x_m, correction.wraps)
    dy = shortest(y - circle[k, 1], correction.half_y_m, correction.wraps)
    reach = reach_m + circle[k, 2]
    return dx * dx + dy * dy < reach * reach


@kernel()
def push_out(correction, arena, x, y, radius_m, bottom_m, near):
    """Return the corrected x, y of a disc, True if it was pushed, and True if it overlaps nothing.

    Only obstacles taller than `bottom_m` are tested, and only if `near`.
    """
    pushed = False
    for _ in range(MAX_PASSES):
        ax, ay = x, y
        if near:
            x, y = _out_of_obstacles(correction, arena, x, y, radius_m, bottom_m)
        if correction.walled:
            max_x, max_y = correction.half_x_m - radius_m, correction.half_y_m - radius_m
            x, y = min(max(x, -max_x), max_x), min(max(y, -max_y), max_y)
        if abs(x - ax) <= EPSILON_M and abs(y - ay) <= EPSILON_M:
            return x, y, pushed, True
        pushed = True
    return x, y, True, False


@kernel()
def _out_of_obstacles(correction, arena, x, y, radius_m, bottom_m):
    """Push a disc out of each obstacle in turn; after a push into another cell continue with that cell's list."""
    cells, circles = correction.cells, len(correction.obstacles.circle)
    c = _cell(cells, arena, x, y)
    i = cells.start[c]
    while i < cells.start[c + 1]:
        k = cells.item[i]
        i += 1
        if k < circles:
            pushed_x, pushed_y = _out_of_circle(correction, k, x, y, radius_m, bottom_m)
        else:
            pushed_x, pushed_y = _out_of_sides(correction, k - circles, x, y, radius_m, bottom_m)
        if pushed_x == x and pushed_y == y:
            continue
        x, y, before = pushed_x, pushed_y, c
        c = _cell(cells, arena, x, y)
        if c != before:
            i = cells.start[c]
            while i < cells.start[c + 1] and cells.item[i] <= k:
                i += 1
    return x, y


@kernel()
def _out_of_circle(correction, k, x, y, radius_m, bottom_m):
    obstacles = correction.obstacles
    dx = shortest(x - obstacles.circle[k, 0], correction.half_x_m, correction.wraps)
    dy = shortest(y - obstacles.circle[k, 1], correction.half_y_m, correction.wraps)
    apart, distance = radius_m + obstacles.circle[k, 2], np.sqrt(dx * dx + dy * dy)
    if obstacles.circle_top_m[k] <= bottom_m or not 0.0 < distance < apart:
        return x, y
    return x + dx / distance * (apart - distance), y + dy / distance * (apart - distance)


@kernel()
def _out_of_sides(correction, k, x, y, radius_m, bottom_m):
    obstacles = correction.obstacles
    if obstacles.polygon_top_m[k] <= bottom_m or not _within(correction, obstacles.polygon, k, x, y, radius_m):
        return x, y
    # The image of the disc that is nearest to the polygon.
    cx, cy = obstacles.polygon[k, 0], obstacles.polygon[k, 1]
    px = cx + shortest(x - cx, correction.half_x_m, correction.wraps)
    py = cy + shortest(y - cy, correction.half_y_m, correction.wraps)
    start, stop = obstacles.side_start[k], obstacles.side_start[k + 1]
    dx, dy = _out_of_polygon(obstacles.side, start, stop, px, py, radius_m)
    return x + dx, y + dy


@kernel()
def _out_of_polygon(side, start, stop, x, y, radius_m):
    """Return the shortest displacement that moves a disc out of a convex polygon, (0, 0) without overlap."""
    outside, outer_side = -np.inf, start  # the side whose line has the centre farthest outside
    for s in range(start, stop):
        apart = side[s, 2] * x + side[s, 3] * y - side[s, 4]
        if apart > outside:
            outside, outer_side = apart, s
    if outside >= radius_m:
        return 0.0, 0.0
    if outside <= 0.0:
        return side[outer_side, 2] * (radius_m - outside), side[outer_side, 3] * (radius_m - outside)
    min_distance2, nearest_x, nearest_y = np.inf, 0.0, 0.0
    for s in range(start, stop):
        ax, ay = side[s, 0], side[s, 1]
        next_side = s + 1 if s + 1 < stop else start
        bx, by = side[next_side, 0] - ax, side[next_side, 1] - ay
        share = min(max(((x - ax) * bx + (y - ay) * by) / (bx * bx + by * by), 0.0), 1.0)
        dx, dy = x - ax - share * bx, y - ay - share * by
        if dx * dx + dy * dy < min_distance2:
            min_distance2, nearest_x, nearest_y = dx * dx + dy * dy, dx, dy
    distance = np.sqrt(min_distance2)
    if distance >= radius_m:
        return 0.0, 0.0
    return nearest_x / distance * (radius_m - distance), nearest_y / distance * (radius_m - distance)


@njit()
def overlaps(state, discs, pushed, running, correction, cells):
    """Return rising codes of pairs of robots that overlap, and of robots that were pushed; see `count_began`.

    Args:
        state: (arenas, n, 6) x, y first.
        discs: the robots' Discs.
        pushed: (arenas, n) True for robots that something fixed pushed.
        running: (arenas,) arenas that count.
        correction: a PositionCorrection, for the extents of an arena.
        cells: at least as wide as a robot; filled with robots.
    """
    radius_m, bottom_m, top_m = discs
    arenas, n = pushed.shape
    bodies, cell_buffer = n + 1, np.empty(9, np.int64)
    sort(cells, state, running)
    codes, count = np.empty(arenas * n, np.int64), 0
    for arena in range(arenas):
        if not running[arena]:
            continue
        for i in range(n):
            x, y = state[arena, i, 0], state[arena, i, 1]
            for cell in cell_buffer[: cells_around(cell_buffer, cells, arena, x, y)]:
                for k in range(cells.start[cell], cells.start[cell + 1]):
                    j = cells.item[k]
                    if j >= i:
                        break
                    dx = shortest(x - state[arena, j, 0], correction.half_x_m, correction.wraps)
                    dy = shortest(y - state[arena, j, 1], correction.half_y_m, correction.wraps)
                    apart = radius_m[i] + radius_m[j]
                    same_height = bottom_m[i] < top_m[j] and bottom_m[j] < top_m[i]
                    if same_height and dx * dx + dy * dy < apart * apart:
                        codes = _room_for(codes, count)
                        codes[count] = (arena * bodies + j) * bodies + i
                        count += 1
            if pushed[arena, i]:
                codes = _room_for(codes, count)
                codes[count] = (arena * bodies + i) * bodies + n
                count += 1
    codes = codes[:count].copy()
    codes.sort()
    return codes


@njit()
def _room_for(codes, count):
    """Return the codes with room for one more."""
    if count < len(codes):
        return codes
    wider = np.empty(2 * len(codes), np.int64)
    wider[:count] = codes
    return wider


class PositionCorrections:
    """The walls and obstacles of an engine's arenas: sorted once, or in each tick where an obstacle can be pushed."""

    def __init__(self, config: EngineConfig) -> None:
        """List no obstacles yet: the first `within` does."""
        self._obstacles, self._size_m = config.obstacles, config.size_m
        self._movable = any(obstacle.movable for arena in config.initial_obstacles for obstacle in arena)
        self._reach_m = 0.0
        width, height = config.size_m
        walled, wraps = config.boundary == "walls", config.boundary == "torus"
        self._current = PositionCorrection(0.5 * width, 0.5 * height, walled, wraps, config.obstacles, self._cells())

    def within(self, reach_m: float) -> PositionCorrection:
        """Return the present walls and obstacles, for queries within at least `reach_m`."""
        grown = reach_m > self._reach_m
        if grown:
            self._reach_m = REACH_GROWTH * reach_m
        if grown or self._movable:
            self._current = self._current._replace(cells=self._cells())
        return self._current

    def _cells(self) -> Grid:
        # Without sides, polygons are listed by the circles around them, which are tested first. Cells wrap, so on a
        # torus, too, each obstacle is listed across the border without an image.
        circles_only = self._obstacles._replace(
            side_start=np.zeros_like(self._obstacles.side_start), side=np.empty((0, 5), np.float64)
        )
        reach_m = min(self._reach_m, sum(self._size_m))  # a greater reach covers all cells as well
        return obstacles_within(circles_only, self._size_m, reach_m, torus=False).cells
