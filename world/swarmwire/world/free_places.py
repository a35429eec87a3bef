"""Keyed candidates for a place, and the test that one is free. Compiled."""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np
from numba import njit

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.draws_compiled import uniform
from swarmwire.comms.geometry import sides_of
from swarmwire.comms.grid import cell_of

MOST_CANDIDATES = 1000
GAP_M = 1e-3  # least free space between two things at the start
TURN_RAD = 2.0 * np.pi


class Region(NamedTuple):
    """Where candidates lie: a disc or a rectangle."""

    round: bool
    x_m: float
    y_m: float
    half_x_m: float  # the radius of a disc
    half_y_m: float


class Taken(NamedTuple):
    """What stands in an arena so far. Robots are found by cell: head[cell], then follow[robot], until -1."""

    half_x_m: float  # of the arena
    half_y_m: float
    circle: FloatArray  # (circles, 3) x, y, radius of round obstacles
    side_start: IntArray  # (polygons + 1,) polygon k has the sides side_start[k] to side_start[k + 1] - 1
    side: FloatArray  # (sides, 5) as `sides_of` has them
    cell_m: float
    head: IntArray  # (ny, nx) last robot put into a cell
    follow: IntArray  # (robots,) the robot put there before
    robot: FloatArray  # (robots, 3) x, y, radius


@njit(cache=True)
def candidate(region, key, entity, attempt, purpose):
    """Candidate `attempt` of an entity: x, y, whether it lies in the region."""
    u = 2.0 * uniform(key, entity, attempt, 0, purpose) - 1.0
    v = 2.0 * uniform(key, entity, attempt, 1, purpose) - 1.0
    inside = not region.round or u * u + v * v <= 1.0
    return region.x_m + u * region.half_x_m, region.y_m + v * region.half_y_m, inside


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
def _disc_clear_of_obstacles(taken, x, y, radius):
    reach = radius + GAP_M
    if abs(x) + reach > taken.half_x_m or abs(y) + reach > taken.half_y_m:
        return False
    for i in range(len(taken.circle)):
        dx, dy, apart = x - taken.circle[i, 0], y - taken.circle[i, 1], reach + taken.circle[i, 2]
        if dx * dx + dy * dy < apart * apart:
            return False
    for k in range(len(taken.side_start) - 1):
        if _distance(x, y, taken.side[taken.side_start[k] : taken.side_start[k + 1]]) < reach:
            return False
    return True


@njit(cache=True)
def _disc_clear_of_robots(taken, x, y, radius):
    ny, nx = taken.head.shape
    column = cell_of(x, -taken.half_x_m, taken.cell_m, nx)
    row = cell_of(y, -taken.half_y_m, taken.cell_m, ny)
    for j in range(max(row - 1, 0), min(row + 2, ny)):
        for i in range(max(column - 1, 0), min(column + 2, nx)):
            other = taken.head[j, i]
            while other >= 0:
                dx, dy = x - taken.robot[other, 0], y - taken.robot[other, 1]
                apart = radius + taken.robot[other, 2] + GAP_M
                if dx * dx + dy * dy < apart * apart:
                    return False
                other = taken.follow[other]
    return True


@njit(cache=True)
def _parted(a, b):
    """Whether a side of polygon a has all of b beyond it, with a gap (half of the separating axis theorem)."""
    for i in range(len(a)):
        least = np.inf
        for j in range(len(b)):
            least = min(least, a[i, 2] * b[j, 0] + a[i, 3] * b[j, 1])
        if least - a[i, 4] >= GAP_M:
            return True
    return False


@njit(cache=True)
def _polygon_clear_of_obstacles(taken, sides):
    for i in range(len(sides)):
        if abs(sides[i, 0]) + GAP_M > taken.half_x_m or abs(sides[i, 1]) + GAP_M > taken.half_y_m:
            return False
    for i in range(len(taken.circle)):
        if _distance(taken.circle[i, 0], taken.circle[i, 1], sides) < taken.circle[i, 2] + GAP_M:
            return False
    for k in range(len(taken.side_start) - 1):
        other = taken.side[taken.side_start[k] : taken.side_start[k + 1]]
        if not (_parted(sides, other) or _parted(other, sides)):
            return False
    return True


@njit(cache=True)
def free_circle(
    taken: Taken, region: Region, key: np.uint64, entity: int, purpose: int, radius: float
) -> tuple[float, float]:
    """x, y of the first candidate where a disc is clear of all obstacles; nan if there is none."""
    for attempt in range(MOST_CANDIDATES):
        x, y, inside = candidate(region, key, entity, attempt, purpose)
        if inside and _disc_clear_of_obstacles(taken, x, y, radius):
            return x, y
    return np.nan, np.nan


@njit(cache=True)
def free_polygon(
    taken: Taken, region: Region, key: np.uint64, entity: int, purpose: int, corners: FloatArray, heading: float
) -> tuple[float, float, float]:
    """x, y, heading of the first candidate where a polygon is clear of all obstacles; nan if there is none.

    `corners` (k, 2) are those at the origin and heading 0. A heading that is not finite is drawn with each candidate.
    """
    placed = np.empty_like(corners)
    for attempt in range(MOST_CANDIDATES):
        turn = heading
        if not np.isfinite(heading):
            turn = (uniform(key, entity, attempt, 2, purpose) - 0.5) * TURN_RAD
        x, y, inside = candidate(region, key, entity, attempt, purpose)
        c, s = np.cos(turn), np.sin(turn)
        placed[:, 0] = x + c * corners[:, 0] - s * corners[:, 1]
        placed[:, 1] = y + s * corners[:, 0] + c * corners[:, 1]
        if inside and _polygon_clear_of_obstacles(taken, sides_of(placed)):
            return x, y, turn
    return np.nan, np.nan, np.nan


@njit(cache=True)
def put_robots(
    taken: Taken,
    region: Region,
    fixed: FloatArray,
    key: np.uint64,
    purpose: int,
    start: int,
    stop: int,
    radius: float,
) -> int:
    """Put robots start to stop - 1, each at its first free candidate; the first that found no place, else -1.

    `fixed` (robots put, 2) gives each its only candidate; with no rows candidates are drawn from the region.
    """
    ny, nx = taken.head.shape
    for robot in range(start, stop):
        found = False
        for attempt in range(1 if len(fixed) else MOST_CANDIDATES):
            if len(fixed):
                x, y, inside = fixed[robot - start, 0], fixed[robot - start, 1], True
            else:
                x, y, inside = candidate(region, key, robot, attempt, purpose)
            found = inside and _disc_clear_of_obstacles(taken, x, y, radius)
            found = found and _disc_clear_of_robots(taken, x, y, radius)
            if found:
                break
        if not found:
            return robot
        taken.robot[robot] = x, y, radius
        cell = cell_of(y, -taken.half_y_m, taken.cell_m, ny), cell_of(x, -taken.half_x_m, taken.cell_m, nx)
        taken.follow[robot] = taken.head[cell]
        taken.head[cell] = robot
    return -1
