"""What stands in an arena so far, and whether a disc or a polygon is clear of it. Compiled."""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np
from numba import njit

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.geometry.obstacles import sides_of
from swarmwire.comms.geometry.robot_index import cell_of

GAP_M = 1e-3  # least free space between two things at the start
ROUNDING_M = 1e-9


class Taken(NamedTuple):
    """What stands in an arena so far. Robots are found by cell: head[cell], then follow[robot], until -1."""

    half_x_m: float  # of the arena
    half_y_m: float
    wraps: bool  # on a torus, where distances are the shortest
    circle: FloatArray  # (circles, 4) x, y, radius and height of round obstacles
    around: FloatArray  # (polygons, 4) x, y, radius of a circle around each, and its height
    side_start: IntArray  # (polygons + 1,) polygon k has the sides side_start[k] to side_start[k + 1] - 1
    side: FloatArray  # (sides, 5) as `sides_of` has them
    cell_m: float
    head: IntArray  # (ny, nx) last robot put into a cell
    follow: IntArray  # (robots,) the robot put there before
    robot: FloatArray  # (robots, 5) x, y, radius, height of its lower and of its upper side


class Disc(NamedTuple):
    """What finds a place: a disc, how far it is to keep from others, and the heights at which it could touch them."""

    radius_m: float
    gap_m: float
    bottom_m: float
    top_m: float


@njit(cache=True)
def on_torus(at_m, half_m):
    """The place on a torus as a coordinate from -half_m to half_m."""
    return at_m - 2.0 * half_m * np.floor((at_m + half_m) / (2.0 * half_m))


@njit(cache=True)
def _distance(x, y, sides):
    """Distance in m of a point from a convex polygon, 0 within."""
    within, least2 = True, np.inf
    for i in range(len(sides)):
        ax, ay = sides[i, 0], sides[i, 1]
        bx, by = sides[(i + 1) % len(sides), 0] - ax, sides[(i + 1) % len(sides), 1] - ay
        within = within and sides[i, 2] * x + sides[i, 3] * y <= sides[i, 4]
        share = min(max(((x - ax) * bx + (y - ay) * by) / (bx * bx + by * by), 0.0), 1.0)
        dx, dy = x - ax - share * bx, y - ay - share * by
        least2 = min(least2, dx * dx + dy * dy)
    return 0.0 if within else np.sqrt(least2)


@njit(cache=True)
def disc_clear_of_obstacles(taken, x, y, disc):
    """Whether a disc at x, y lies within the arena, or on the torus, and keeps clear of all obstacles."""
    if taken.wraps:
        for across in (-1, 0, 1):
            for up in (-1, 0, 1):
                if not _disc_clear_here(taken, x + 2 * across * taken.half_x_m, y + 2 * up * taken.half_y_m, disc):
                    return False
        return True
    return within_arena(taken, x, y, disc.radius_m) and _disc_clear_here(taken, x, y, disc)


@njit(cache=True)
def within_arena(taken, x, y, radius_m):
    """Whether a disc at x, y is clear of where the walls are, or would be."""
    reach = radius_m + GAP_M
    return abs(x) + reach <= taken.half_x_m and abs(y) + reach <= taken.half_y_m


@njit(cache=True)
def _disc_clear_here(taken, x, y, disc):
    reach = disc.radius_m + disc.gap_m
    for i in range(len(taken.circle)):
        dx, dy, apart = x - taken.circle[i, 0], y - taken.circle[i, 1], reach + taken.circle[i, 2]
        if dx * dx + dy * dy < apart * apart and taken.circle[i, 3] > disc.bottom_m:
            return False
    for k in range(len(taken.around)):
        dx, dy, near = x - taken.around[k, 0], y - taken.around[k, 1], reach + taken.around[k, 2] + ROUNDING_M
        if dx * dx + dy * dy > near * near or taken.around[k, 3] <= disc.bottom_m:
            continue
        if _distance(x, y, taken.side[taken.side_start[k] : taken.side_start[k + 1]]) < reach:
            return False
    return True


@njit(cache=True)
def disc_clear_of_robots(taken, x, y, disc):
    """Whether a disc at x, y keeps clear of all robots whose height it shares."""
    ny, nx = taken.head.shape
    column = cell_of(x, -taken.half_x_m, taken.cell_m, nx)
    row = cell_of(y, -taken.half_y_m, taken.cell_m, ny)
    # On a torus the last cell may be cut, so that two cells hold what one would.
    cells = 2 if taken.wraps else 1
    for j in range(row - cells, row + cells + 1):
        for i in range(column - cells, column + cells + 1):
            if not taken.wraps and not (0 <= j < ny and 0 <= i < nx):
                continue
            other = taken.head[j % ny, i % nx]
            while other >= 0:
                if _too_near(taken, x, y, disc, taken.robot[other]):
                    return False
                other = taken.follow[other]
    return True


@njit(cache=True)
def _too_near(taken, x, y, disc, other):
    dx, dy = x - other[0], y - other[1]
    if taken.wraps:
        dx, dy = on_torus(dx, taken.half_x_m), on_torus(dy, taken.half_y_m)
    apart = disc.radius_m + other[2] + disc.gap_m
    return dx * dx + dy * dy < apart * apart and other[4] > disc.bottom_m and disc.top_m > other[3]


@njit(cache=True)
def _parted(a, b, gap_m):
    """Whether a side of polygon a has all of b beyond it, with a gap (half of the separating axis theorem)."""
    for i in range(len(a)):
        least = np.inf
        for j in range(len(b)):
            least = min(least, a[i, 2] * b[j, 0] + a[i, 3] * b[j, 1])
        if least - a[i, 4] >= gap_m:
            return True
    return False


@njit(cache=True)
def polygon_clear_of_obstacles(taken, corners, gap_m):
    """Whether a convex polygon, corners (k, 2) counter-clockwise, lies within the arena, clear of all obstacles."""
    for i in range(len(corners)):
        if abs(corners[i, 0]) + GAP_M > taken.half_x_m or abs(corners[i, 1]) + GAP_M > taken.half_y_m:
            return False
    if not taken.wraps:
        return _polygon_clear_here(taken, sides_of(corners), gap_m)
    for across in (-1, 0, 1):
        for up in (-1, 0, 1):
            there = corners + np.array([2 * across * taken.half_x_m, 2 * up * taken.half_y_m])
            if not _polygon_clear_here(taken, sides_of(there), gap_m):
                return False
    return True


@njit(cache=True)
def _polygon_clear_here(taken, sides, gap_m):
    for i in range(len(taken.circle)):
        if _distance(taken.circle[i, 0], taken.circle[i, 1], sides) < taken.circle[i, 2] + gap_m:
            return False
    for k in range(len(taken.around)):
        other = taken.side[taken.side_start[k] : taken.side_start[k + 1]]
        if not (_parted(sides, other, gap_m) or _parted(other, sides, gap_m)):
            return False
    return True
