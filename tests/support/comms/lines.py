"""Lines tested against every obstacle of their arena, one after the other: kernels with an index must agree."""

import math

import numpy as np

from swarmwire.comms.base.geometry.line_of_sight import is_blocked
from swarmwire.comms.base.geometry.obstacle_index import ObstacleIndex, obstacles_within
from swarmwire.comms.base.geometry.obstacles import (
    Obstacles,
    obstacle_arrays,
    ray_to_circle,
    ray_to_polygon,
    to_nearest,
)
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.radio.propagation.obstruction import chord_in_circle, chord_in_polygon, crossed_and_inside_m

Arenas = tuple[tuple[Obstacle, ...], ...]


def indexed(arenas: Arenas, size_m: tuple[float, float]) -> ObstacleIndex:
    """The obstacle index that a radio has."""
    return obstacles_within(obstacle_arrays(arenas), size_m, 0.0, torus=False)


def is_blocked_on_floor(
    obstacles: ObstacleIndex, arena: int, x0: float, y0: float, x1: float, y1: float, *wrap_m: float
) -> bool:
    """Whether an obstacle blocks the line between two points on the floor; of a torus with the sides `wrap_m`."""
    return is_blocked(obstacles, arena, x0, y0, 0.0, x1, y1, 0.0, *(wrap_m or (0.0, 0.0)))


def crossed_on_floor(obstacles: ObstacleIndex, arena: int, ax: float, ay: float, bx: float, by: float):
    """`crossed_and_inside_m` of a line between two points on the floor, with a buffer that an earlier line left."""
    entered = np.full((len(obstacles.shape), 2), np.nan)
    return crossed_and_inside_m(obstacles, entered, arena, ax, ay, 0.0, bx, by, 0.0)


def touches_any(obstacles: Obstacles, arena: int, x0: float, y0: float, x1: float, y1: float) -> bool:
    """Whether an obstacle of the arena touches the straight line between two points."""
    dx, dy = x1 - x0, y1 - y0
    length = math.sqrt(dx * dx + dy * dy)
    if length == 0.0:
        return False
    ray = x0, y0, dx / length, dy / length
    circles, polygons = _rows(obstacles, arena)
    return any(ray_to_circle(*ray, *obstacles.circle[k]) <= length for k in circles) or any(
        ray_to_polygon(*ray, obstacles, k) <= length for k in polygons
    )


def touches_any_on_torus(
    obstacles: Obstacles, arena: int, x0: float, y0: float, x1: float, y1: float, size_m: tuple[float, float]
) -> bool:
    """The same for the shortest line on a torus, where it leaves the arena and where it comes in again."""
    over_x, over_y = to_nearest(x1 - x0, size_m[0]), to_nearest(y1 - y0, size_m[1])
    x1, y1 = x1 + over_x, y1 + over_y
    return any(
        touches_any(obstacles, arena, x0 - dx, y0 - dy, x1 - dx, y1 - dy)
        for dx in {0.0, over_x}
        for dy in {0.0, over_y}
    )


def crossed_and_inside(
    obstacles: Obstacles, arena: int, ax: float, ay: float, bx: float, by: float
) -> tuple[int, float]:
    """Number of obstacles of the arena that the line between two points enters, and its length inside them in m."""
    if (bx, by) < (ax, ay):
        ax, ay, bx, by = bx, by, ax, ay
    dx, dy = bx - ax, by - ay
    length = math.sqrt(dx * dx + dy * dy)
    if length == 0.0:
        return 0, 0.0
    line = ax, ay, dx / length, dy / length, length
    circles, polygons = _rows(obstacles, arena)
    chords_m = [chord_in_circle(*line, *obstacles.circle[k]) for k in circles]
    near = (k for k in polygons if chord_in_circle(*line, *obstacles.polygon[k]) > 0.0)
    chords_m += [chord_in_polygon(*line, obstacles, k) for k in near]
    inside_m = 0.0
    for chord_m in chords_m:  # `sum` compensates for rounding from Python 3.12 on
        inside_m += chord_m
    return int(np.count_nonzero(chords_m)), inside_m


def _rows(obstacles: Obstacles, arena: int) -> tuple[range, range]:
    starts = obstacles.circle_start, obstacles.polygon_start
    circles, polygons = (range(int(start[arena]), int(start[arena + 1])) for start in starts)
    return circles, polygons
