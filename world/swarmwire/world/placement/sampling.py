"""Rejection sampling of positions: the first free of the keyed candidates in a region. Compiled."""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.draws_compiled import uniform
from swarmwire.comms.base.geometry.robot_index import column_of, row_of
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.base.math import compiled as math_compiled
from swarmwire.comms.base.sentinels import NO_ROBOT
from swarmwire.world.placement.occupancy import (
    Disc,
    Occupancy,
    disc_clear_of_obstacles,
    disc_clear_of_robots,
    on_torus,
    polygon_clear_of_obstacles,
    within_arena,
)

MAX_CANDIDATES = 1000
BOX, DISC, RING = range(3)
TURN_RAD = 2.0 * np.pi


class Region(NamedTuple):
    """The region of the candidates."""

    kind: int  # BOX, DISC or RING
    x_m: float
    y_m: float
    half_x_m: float  # the radius of a disc, the outer radius of a ring
    half_y_m: float
    inner_m: float  # inner radius of a ring


@njit()
def candidate(region, key, entity, attempt, purpose):
    """Return candidate `attempt` of an entity: x, y, True if it lies in the region."""
    u = uniform(key, entity, attempt, 0, purpose)
    v = uniform(key, entity, attempt, 1, purpose)
    if region.kind == RING:
        inner2 = region.inner_m * region.inner_m
        r = np.sqrt(inner2 + u * (region.half_x_m * region.half_x_m - inner2))
        return region.x_m + r * math_compiled.cos(TURN_RAD * v), region.y_m + r * math_compiled.sin(TURN_RAD * v), True
    u, v = 2.0 * u - 1.0, 2.0 * v - 1.0
    inside = region.kind == BOX or u * u + v * v <= 1.0
    return region.x_m + u * region.half_x_m, region.y_m + v * region.half_y_m, inside


@njit()
def free_circle(
    occupancy: Occupancy, region: Region, key: np.uint64, entity: int, purpose: int, disc: Disc
) -> tuple[float, float]:
    """Return x, y of the first candidate at which a disc is clear of all obstacles; nan if there is none."""
    for attempt in range(MAX_CANDIDATES):
        x, y, inside = candidate(region, key, entity, attempt, purpose)
        inside = inside and within_arena(occupancy, x, y, disc.radius_m)  # obstacles lie within even a torus
        if inside and disc_clear_of_obstacles(occupancy, x, y, disc):
            return x, y
    return np.nan, np.nan


@njit()
def free_polygon(
    occupancy: Occupancy,
    region: Region,
    key: np.uint64,
    entity: int,
    purpose: int,
    corners: FloatArray,
    heading_rad: float,
    gap_m: float,
) -> tuple[float, float, float]:
    """Return x, y, heading of the first candidate at which a polygon is clear of all obstacles; nan if there is none.

    `corners` (k, 2) are those at the origin and heading 0. A heading that is not finite is drawn with each candidate.
    """
    placed = np.empty_like(corners)
    for attempt in range(MAX_CANDIDATES):
        turn = heading_rad
        if not np.isfinite(heading_rad):
            turn = (uniform(key, entity, attempt, 2, purpose) - 0.5) * TURN_RAD
        x, y, inside = candidate(region, key, entity, attempt, purpose)
        c, s = math_compiled.cos(turn), math_compiled.sin(turn)
        placed[:, 0] = x + c * corners[:, 0] - s * corners[:, 1]
        placed[:, 1] = y + s * corners[:, 0] + c * corners[:, 1]
        if inside and polygon_clear_of_obstacles(occupancy, placed, gap_m):
            return x, y, turn
    return np.nan, np.nan, np.nan


@njit()
def place_robots(
    occupancy: Occupancy,
    region: Region,
    fixed: FloatArray,
    key: np.uint64,
    purpose: int,
    start: int,
    stop: int,
    disc: Disc,
    tests: bool,
) -> int:
    """Place robots start to stop - 1, each at its first free candidate; return the first without room, or NO_ROBOT.

    `fixed` (stop - start, 2) holds the only candidate of each; without rows candidates are drawn from the region. If
    `tests` is False, each is placed at its first candidate, free or not.
    """
    for robot in range(start, stop):
        is_free = False
        for attempt in range(1 if len(fixed) else MAX_CANDIDATES):
            if len(fixed):
                x, y, inside = fixed[robot - start, 0], fixed[robot - start, 1], True
            else:
                x, y, inside = candidate(region, key, robot, attempt, purpose)
            if occupancy.wraps:
                x, y = on_torus(x, occupancy.half_x_m), on_torus(y, occupancy.half_y_m)
            is_free = inside and disc_clear_of_obstacles(occupancy, x, y, disc)
            is_free = is_free and disc_clear_of_robots(occupancy, x, y, disc)
            if is_free or not tests:
                break
        if tests and not is_free:
            return robot
        # Not an assignment to the row: its error's text takes seconds to compile.
        for column, value in enumerate((x, y, disc.radius_m, disc.bottom_m, disc.top_m)):
            occupancy.robot[robot, column] = value
        cell = row_of(occupancy.cells, y) * occupancy.cells.nx + column_of(occupancy.cells, x)
        occupancy.next_robot[robot] = occupancy.head[cell]
        occupancy.head[cell] = robot
    return NO_ROBOT
