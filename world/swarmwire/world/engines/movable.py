"""Movable obstacles: their physical properties, and their poses in the shared obstacle arrays. Compiled."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from swarmwire.comms.base import math as portable
from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.comms.base.geometry.obstacles import Obstacles, sides_of
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.base.math import compiled as math_compiled

GRAVITY_MPS2 = 9.81
FLOOR_FRICTION = 0.5  # coefficient of friction of an obstacle on the floor


@dataclass(frozen=True, slots=True)
class Load:
    """A movable obstacle in the physics; the origin of its frame is its centre of mass."""

    mass_kg: float
    radius_m: float  # radius of a cylinder, else 0
    corners_m: FloatArray  # (corners, 2), counter-clockwise; no rows for a cylinder
    centre_m: tuple[float, float]  # the centre of mass in the frame of the obstacle's table
    x_m: float  # position of the centre of mass in the arena
    y_m: float
    heading_rad: float

    @property
    def reach_m(self) -> float:
        """Mean distance of its area from its centre: the lever of friction when it turns."""
        if self.radius_m:
            return 2.0 / 3.0 * self.radius_m
        side = sides_of(self.corners_m)
        angle = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
        towards = portable.cos(angle)[:, None] * side[:, 2] + portable.sin(angle)[:, None] * side[:, 3]
        rim = np.where(towards > 0.0, side[:, 4] / np.maximum(towards, 1e-12), np.inf).min(axis=1)
        return float(2.0 / 3.0 * portable.ordered_sum(rim * rim * rim) / portable.ordered_sum(rim * rim))


def load_of(obstacle: Obstacle) -> Load:
    """Return the load of a movable obstacle."""
    assert obstacle.mass_kg is not None
    if obstacle.shape == "cylinder":
        pose = obstacle.x_m, obstacle.y_m, 0.0
        return Load(obstacle.mass_kg, obstacle.radius_m, np.empty((0, 2)), (0.0, 0.0), *pose)
    corners = replace(obstacle, x_m=0.0, y_m=0.0, heading_rad=0.0).corners_m
    cx, cy = _centroid(corners)
    c, s = portable.cos(obstacle.heading_rad), portable.sin(obstacle.heading_rad)
    x, y = obstacle.x_m + (c * cx - s * cy), obstacle.y_m + (s * cx + c * cy)
    return Load(obstacle.mass_kg, 0.0, corners - np.array([cx, cy]), (cx, cy), x, y, obstacle.heading_rad)


def _centroid(corners: FloatArray) -> tuple[float, float]:
    (x, y), (u, v) = corners.T, np.roll(corners, -1, axis=0).T
    twice = x * v - u * y
    area = 3.0 * portable.ordered_sum(twice)
    x_sum, y_sum = portable.ordered_sum((x + u) * twice), portable.ordered_sum((y + v) * twice)
    return float(x_sum / area), float(y_sum / area)


class Movables:
    """The movable obstacles of all arenas, k in each.

    Attributes:
        loads: the loads of each arena.
        pose: (arenas, k, 3) x, y in m, heading in rad (not wrapped), in the frame of an obstacle's table.
    """

    def __init__(self, initial: Sequence[tuple[Obstacle, ...]], obstacles: Obstacles) -> None:
        """Select the movable of each arena's `initial` obstacles, in order; `obstacles` holds them as arrays."""
        movable = [[obstacle for obstacle in arena if obstacle.movable] for arena in initial]
        self.loads = [[load_of(obstacle) for obstacle in arena] for arena in movable]
        self.pose = np.array([[(o.x_m, o.y_m, o.heading_rad) for o in arena] for arena in movable], np.float64).reshape(
            len(initial), -1, 3
        )
        self._obstacles = obstacles
        circular, rows = _rows(initial, obstacles)
        self._circular: BoolArray = np.array(circular, np.bool_)
        self._rows: IntArray = np.array(rows, np.int64)
        loads = [load for arena in self.loads for load in arena]
        self._centre = np.array([load.centre_m for load in loads], np.float64).reshape(-1, 2)
        self._corner = np.zeros((len(obstacles.side), 2))
        for load, is_circle, row in zip(loads, circular, rows, strict=True):
            if not is_circle:
                self._corner[obstacles.side_start[row] : obstacles.side_start[row + 1]] = load.corners_m

    def move(self, state: FloatArray) -> None:
        """Move the obstacles to `state` (arenas, k, 3 or more): x, y of the centre of mass, heading."""
        _move(state, self._circular, self._rows, self._centre, self._corner, self._obstacles, self.pose)


def _rows(initial: Sequence[tuple[Obstacle, ...]], obstacles: Obstacles) -> tuple[list[bool], list[int]]:
    """Return, for each movable obstacle, True for a circle, and its row among the circles or the polygons."""
    circular: list[bool] = []
    rows: list[int] = []
    for arena, arena_obstacles in enumerate(initial):
        next_row = {True: int(obstacles.circle_start[arena]), False: int(obstacles.polygon_start[arena])}
        for obstacle in arena_obstacles:
            is_circle = obstacle.shape == "cylinder"
            if obstacle.movable:
                circular.append(is_circle)
                rows.append(next_row[is_circle])
            next_row[is_circle] += 1
    return circular, rows


@njit()
def _move(
    state: AnyArray,
    circular: AnyArray,
    rows: AnyArray,
    centre: AnyArray,
    corner: AnyArray,
    obstacles: Any,
    pose: AnyArray,
):
    arenas, per_arena = pose.shape[:2]
    for arena in range(arenas):
        for i in range(per_arena):
            k = arena * per_arena + i
            x, y, heading, row = state[arena, i, 0], state[arena, i, 1], state[arena, i, 2], rows[k]
            c, s = math_compiled.cos(heading), math_compiled.sin(heading)
            cx, cy = centre[k]
            pose[arena, i] = x - (c * cx - s * cy), y - (s * cx + c * cy), heading
            if circular[k]:
                obstacles.circle[row, 0], obstacles.circle[row, 1] = x, y
                continue
            start, stop = obstacles.side_start[row], obstacles.side_start[row + 1]
            turned = np.empty((stop - start, 2))
            turned[:, 0] = x + c * corner[start:stop, 0] - s * corner[start:stop, 1]
            turned[:, 1] = y + s * corner[start:stop, 0] + c * corner[start:stop, 1]
            obstacles.side[start:stop] = sides_of(turned)
            obstacles.polygon[row, 0], obstacles.polygon[row, 1] = turned[:, 0].mean(), turned[:, 1].mean()
