"""Keyed candidates for a place, and the test that one is free. Compiled."""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np
from numba import njit

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.draws_compiled import uniform
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
    box: FloatArray  # (boxes, 6) x, y, half length, half width, cosine and sine of the heading
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
def _distance_to_box(x, y, box):
    """Distance in m of a point from a box, 0 within."""
    ox, oy = x - box[0], y - box[1]
    along = max(abs(box[4] * ox + box[5] * oy) - box[2], 0.0)
    across = max(abs(box[4] * oy - box[5] * ox) - box[3], 0.0)
    return np.sqrt(along * along + across * across)


@njit(cache=True)
def _disc_clear_of_obstacles(taken, x, y, radius):
    reach = radius + GAP_M
    if abs(x) + reach > taken.half_x_m or abs(y) + reach > taken.half_y_m:
        return False
    for i in range(len(taken.circle)):
        dx, dy, apart = x - taken.circle[i, 0], y - taken.circle[i, 1], reach + taken.circle[i, 2]
        if dx * dx + dy * dy < apart * apart:
            return False
    for i in range(len(taken.box)):  # noqa: SIM110 - compiled: no generators
        if _distance_to_box(x, y, taken.box[i]) < reach:
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
def _axis_parts(a, b, ux, uy):
    """Whether the line along the unit vector (ux, uy) shows a gap between two boxes (separating axis theorem)."""
    reach_a = a[2] * abs(a[4] * ux + a[5] * uy) + a[3] * abs(a[4] * uy - a[5] * ux)
    reach_b = b[2] * abs(b[4] * ux + b[5] * uy) + b[3] * abs(b[4] * uy - b[5] * ux)
    return abs((b[0] - a[0]) * ux + (b[1] - a[1]) * uy) >= reach_a + reach_b + GAP_M


@njit(cache=True)
def _box_clear_of_obstacles(taken, box):
    reach_x = box[2] * abs(box[4]) + box[3] * abs(box[5]) + GAP_M
    reach_y = box[2] * abs(box[5]) + box[3] * abs(box[4]) + GAP_M
    if abs(box[0]) + reach_x > taken.half_x_m or abs(box[1]) + reach_y > taken.half_y_m:
        return False
    for i in range(len(taken.circle)):
        if _distance_to_box(taken.circle[i, 0], taken.circle[i, 1], box) < taken.circle[i, 2] + GAP_M:
            return False
    for i in range(len(taken.box)):
        b = taken.box[i]
        parted = _axis_parts(box, b, box[4], box[5]) or _axis_parts(box, b, -box[5], box[4])
        if not (parted or _axis_parts(box, b, b[4], b[5]) or _axis_parts(box, b, -b[5], b[4])):
            return False
    return True


@njit(cache=True)
def free_circle(
    taken: Taken, region: Region, key: np.uint64, entity: int, purpose: int, radius: float
) -> tuple[float, float]:
    """x, y of the first candidate where a round obstacle is clear of all obstacles; nan if there is none."""
    for attempt in range(MOST_CANDIDATES):
        x, y, inside = candidate(region, key, entity, attempt, purpose)
        if inside and _disc_clear_of_obstacles(taken, x, y, radius):
            return x, y
    return np.nan, np.nan


@njit(cache=True)
def free_box(
    taken: Taken,
    region: Region,
    key: np.uint64,
    entity: int,
    purpose: int,
    half_length: float,
    half_width: float,
    heading: float,
) -> tuple[float, float, float]:
    """x, y, heading of the first candidate where a box is clear of all obstacles; nan if there is none.

    A heading that is not finite is drawn with each candidate.
    """
    box = np.empty(6)
    box[2], box[3] = half_length, half_width
    for attempt in range(MOST_CANDIDATES):
        turn = heading
        if not np.isfinite(heading):
            turn = (uniform(key, entity, attempt, 2, purpose) - 0.5) * TURN_RAD
        box[0], box[1], inside = candidate(region, key, entity, attempt, purpose)
        box[4], box[5] = np.cos(turn), np.sin(turn)
        if inside and _box_clear_of_obstacles(taken, box):
            return box[0], box[1], turn
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
