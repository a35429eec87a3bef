"""Where a disc ends up that must not stand in obstacles or walls: pushed out the shortest way, so that it slides along.

Compiled. Only obstacles that are listed for the disc's cell are looked at, in their order: the same ones push, and in
the same order, as if all were.
"""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np
from numba import njit

from swarmwire.comms.geometry.obstacle_index import obstacles_within
from swarmwire.comms.geometry.obstacles import Obstacles
from swarmwire.comms.geometry.robot_index import Cells, cell_of, column_of, row_of
from swarmwire.comms.kernels import kernel
from swarmwire.world.engines.engine import EngineConfig

PASSES = 8  # in a corner, what one thing pushes out of itself another may push back
EPSILON_M = 1e-9  # touching by rounding is no overlap


class PositionCorrection(NamedTuple):
    """What holds discs back in every arena, as kernels take it."""

    half_x_m: float
    half_y_m: float
    walled: bool
    wraps: bool
    obstacles: Obstacles
    cells: Cells  # each lists, rising, circle k as k and polygon k as k + circles: those whose circle is within reach


@njit(cache=True)
def shortest(apart_m, half_m, wraps):
    """A difference of coordinates, on a torus that of the nearest images."""
    return apart_m - 2.0 * half_m * np.floor((apart_m + half_m) / (2.0 * half_m)) if wraps else apart_m


@kernel()
def any_near(around, arena, x, y, reach_m, bottom_m):
    """Whether the circle around any obstacle that is taller than `bottom_m` lies within reach of a point.

    The reach is at most that for which the obstacles were listed.
    """
    cells, obstacles, circles = around.cells, around.obstacles, len(around.obstacles.circle)
    c = _cell(cells, arena, x, y)
    for at in range(cells.start[c], cells.start[c + 1]):
        k = cells.item[at]
        if k < circles:
            near = obstacles.circle_top_m[k] > bottom_m and _within(around, obstacles.circle, k, x, y, reach_m)
        else:
            k -= circles
            near = obstacles.polygon_top_m[k] > bottom_m and _within(around, obstacles.polygon, k, x, y, reach_m)
        if near:
            return True
    return False


@kernel()
def _cell(cells, arena, x, y):
    return (arena * cells.ny + row_of(cells, y)) * cells.nx + column_of(cells, x)


@kernel()
def _within(around, circle, k, x, y, reach_m):
    dx = shortest(x - circle[k, 0], around.half_x_m, around.wraps)
    dy = shortest(y - circle[k, 1], around.half_y_m, around.wraps)
    reach = reach_m + circle[k, 2]
    return dx * dx + dy * dy < reach * reach


@kernel()
def held_back(around, arena, x, y, radius_m, bottom_m, near):
    """The place x, y of a disc after it is pushed out, whether it was, and whether it is free there.

    Obstacles are asked only if they are `near`, and only those taller than `bottom_m`.
    """
    pushed = False
    for _ in range(PASSES):
        ax, ay = x, y
        if near:
            x, y = _out_of_obstacles(around, arena, x, y, radius_m, bottom_m)
        if around.walled:
            most_x, most_y = around.half_x_m - radius_m, around.half_y_m - radius_m
            x, y = min(max(x, -most_x), most_x), min(max(y, -most_y), most_y)
        if abs(x - ax) <= EPSILON_M and abs(y - ay) <= EPSILON_M:
            return x, y, pushed, True
        pushed = True
    return x, y, True, False


@kernel()
def _out_of_obstacles(around, arena, x, y, radius_m, bottom_m):
    """Out of one obstacle after the other; who is pushed into another cell goes on with what is listed there."""
    cells, circles = around.cells, len(around.obstacles.circle)
    c = _cell(cells, arena, x, y)
    at = cells.start[c]
    while at < cells.start[c + 1]:
        k = cells.item[at]
        at += 1
        if k < circles:
            out_x, out_y = _out_of_circle(around, k, x, y, radius_m, bottom_m)
        else:
            out_x, out_y = _out_of_sides(around, k - circles, x, y, radius_m, bottom_m)
        if out_x == x and out_y == y:
            continue
        x, y, before = out_x, out_y, c
        c = _cell(cells, arena, x, y)
        if c != before:
            at = cells.start[c]
            while at < cells.start[c + 1] and cells.item[at] <= k:
                at += 1
    return x, y


@kernel()
def _out_of_circle(around, k, x, y, radius_m, bottom_m):
    obstacles = around.obstacles
    dx = shortest(x - obstacles.circle[k, 0], around.half_x_m, around.wraps)
    dy = shortest(y - obstacles.circle[k, 1], around.half_y_m, around.wraps)
    apart, distance = radius_m + obstacles.circle[k, 2], np.sqrt(dx * dx + dy * dy)
    if obstacles.circle_top_m[k] <= bottom_m or not 0.0 < distance < apart:
        return x, y
    return x + dx / distance * (apart - distance), y + dy / distance * (apart - distance)


@kernel()
def _out_of_sides(around, k, x, y, radius_m, bottom_m):
    obstacles = around.obstacles
    if obstacles.polygon_top_m[k] <= bottom_m or not _within(around, obstacles.polygon, k, x, y, radius_m):
        return x, y
    # The image of the disc that is nearest to the polygon.
    cx, cy = obstacles.polygon[k, 0], obstacles.polygon[k, 1]
    px = cx + shortest(x - cx, around.half_x_m, around.wraps)
    py = cy + shortest(y - cy, around.half_y_m, around.wraps)
    start, stop = obstacles.side_start[k], obstacles.side_start[k + 1]
    dx, dy = _out_of_polygon(obstacles.side, start, stop, px, py, radius_m)
    return x + dx, y + dy


@kernel()
def _out_of_polygon(side, start, stop, x, y, radius_m):
    """The shortest way by which a disc leaves a convex polygon, (0, 0) if it is clear."""
    beyond, outer = -np.inf, start  # the side that the centre is furthest beyond, or least behind
    for s in range(start, stop):
        apart = side[s, 2] * x + side[s, 3] * y - side[s, 4]
        if apart > beyond:
            beyond, outer = apart, s
    if beyond >= radius_m:
        return 0.0, 0.0
    if beyond <= 0.0:
        return side[outer, 2] * (radius_m - beyond), side[outer, 3] * (radius_m - beyond)
    least2, nearest_x, nearest_y = np.inf, 0.0, 0.0
    for s in range(start, stop):
        ax, ay = side[s, 0], side[s, 1]
        after = s + 1 if s + 1 < stop else start
        bx, by = side[after, 0] - ax, side[after, 1] - ay
        share = min(max(((x - ax) * bx + (y - ay) * by) / (bx * bx + by * by), 0.0), 1.0)
        dx, dy = x - ax - share * bx, y - ay - share * by
        if dx * dx + dy * dy < least2:
            least2, nearest_x, nearest_y = dx * dx + dy * dy, dx, dy
    distance = np.sqrt(least2)
    if distance >= radius_m:
        return 0.0, 0.0
    return nearest_x / distance * (radius_m - distance), nearest_y / distance * (radius_m - distance)


# --- Which discs overlap: pairs of robots of all arenas, found by cells. Compiled.


@njit(cache=True)
def overlaps(state, radius_m, bottom_m, top_m, held, running, around):
    """Rising codes, as `count_began` has them, of robots that overlap, and of those that are held back.

    Args:
        state: (arenas, n, 6) x, y first.
        radius_m: (n,).
        bottom_m: (n,) height of the lower side; robots above one another do not overlap.
        top_m: (n,) of the upper side.
        held: (arenas, n) held back by something fixed.
        running: (arenas,) others are left out.
        around: the arena's extents, and whether it wraps.
    """
    arenas, n = held.shape
    bodies, widest_m = n + 1, 2.0 * radius_m.max()
    most = 2 * int(np.ceil(np.sqrt(n)))  # cells along a side: some four for each robot
    nx = min(max(int(2.0 * around.half_x_m / widest_m), 1), most)
    ny = min(max(int(2.0 * around.half_y_m / widest_m), 1), most)
    cell_x, cell_y = 2.0 * around.half_x_m / nx, 2.0 * around.half_y_m / ny
    head, follow = np.empty((ny, nx), np.int64), np.empty(n, np.int64)
    codes, found = np.empty(arenas * n, np.int64), 0
    for arena in range(arenas):
        if not running[arena]:
            continue
        head[:] = -1
        for i in range(n):
            x, y = state[arena, i, 0], state[arena, i, 1]
            column = cell_of(x, -around.half_x_m, cell_x, nx)
            row = cell_of(y, -around.half_y_m, cell_y, ny)
            for v in range(_first(row, ny, around.wraps), _last(row, ny, around.wraps) + 1):
                for u in range(_first(column, nx, around.wraps), _last(column, nx, around.wraps) + 1):
                    j = head[_round(v, ny), _round(u, nx)]
                    while j >= 0:
                        dx = shortest(x - state[arena, j, 0], around.half_x_m, around.wraps)
                        dy = shortest(y - state[arena, j, 1], around.half_y_m, around.wraps)
                        apart = radius_m[i] + radius_m[j]
                        level = bottom_m[i] < top_m[j] and bottom_m[j] < top_m[i]
                        if level and dx * dx + dy * dy < apart * apart:
                            codes = _room_for(codes, found)
                            codes[found] = (arena * bodies + j) * bodies + i
                            found += 1
                        j = follow[j]
            follow[i], head[row, column] = head[row, column], i
            if held[arena, i]:
                codes = _room_for(codes, found)
                codes[found] = (arena * bodies + i) * bodies + n
                found += 1
    codes = codes[:found].copy()
    codes.sort()
    return codes


@njit(cache=True)
def _round(cell, cells):
    """The cell itself, of one counted on beyond the border."""
    return cell + cells if cell < 0 else cell - cells if cell >= cells else cell


@njit(cache=True)
def _first(cell, cells, wraps):
    """The first of the cells around one along an axis; on a torus they may be counted on beyond the border."""
    if wraps:
        return cell - 1 if cells > 2 else cell
    return max(cell - 1, 0)


@njit(cache=True)
def _last(cell, cells, wraps):
    """The last of them; none comes twice."""
    if wraps:
        return cell + 1 if cells > 1 else cell
    return min(cell + 1, cells - 1)


@njit(cache=True)
def _room_for(codes, found):
    """The codes with room for one more."""
    if found < len(codes):
        return codes
    wider = np.empty(2 * len(codes), np.int64)
    wider[:found] = codes
    return wider


# --- What holds discs back in the arenas: their walls, and the obstacles by cell.


SPARE = 1.25  # of a reach that has grown, so that robots that gather speed do not have the obstacles sorted each tick


class PositionCorrections:
    """The hindrances of a setting: obstacles are sorted once, or in each tick where some of them can be pushed."""

    def __init__(self, setting: EngineConfig) -> None:
        """Nothing is sorted yet for any reach."""
        self._obstacles, self._size_m = setting.obstacles, setting.size_m
        self._move = any(obstacle.movable for standing in setting.standing for obstacle in standing)
        self._reach_m = 0.0
        width, height = setting.size_m
        walled, wraps = setting.boundary == "walls", setting.boundary == "torus"
        self._now = PositionCorrection(0.5 * width, 0.5 * height, walled, wraps, setting.obstacles, self._cells())

    def within(self, reach_m: float) -> PositionCorrection:
        """As they stand now, for looking at least `reach_m` far."""
        grown = reach_m > self._reach_m
        if grown:
            self._reach_m = SPARE * reach_m
        if grown or self._move:
            self._now = self._now._replace(cells=self._cells())
        return self._now

    def _cells(self) -> Cells:
        # Without their sides polygons are listed by the circles around them, which is what discs ask for first. Cells
        # are rolled up: on a torus, too, each obstacle is listed across the border without an image of it.
        bare = self._obstacles._replace(
            side_start=np.zeros_like(self._obstacles.side_start), side=np.empty((0, 5), np.float64)
        )
        reach_m = min(self._reach_m, sum(self._size_m))  # farther is in all cells
        return obstacles_within(bare, self._size_m, reach_m, torus=False).cells
