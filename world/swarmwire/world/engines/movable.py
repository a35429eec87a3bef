"""Movable obstacles: their poses, kept up to date in the shared obstacle arrays. Compiled."""

# pyright: basic, reportUnknownMemberType=false

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.base.geometry.obstacles import Obstacles, sides_of
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.base.kernels import njit

GRAVITY_MPS2 = 9.81
FLOOR_FRICTION = 0.5  # of an obstacle on the floor


@dataclass(frozen=True, slots=True)
class Load:
    """What the physics needs to know of one movable obstacle; the frame is its own, with its centre of mass at 0."""

    mass_kg: float
    radius_m: float  # of a cylinder, else 0
    corners_m: FloatArray  # (corners, 2), counter-clockwise; none of a cylinder
    centre_m: tuple[float, float]  # the centre of mass in the frame of the obstacle's table
    x_m: float  # where its centre of mass is in the arena
    y_m: float
    heading_rad: float

    @property
    def reach_m(self) -> float:
        """The mean distance of its area from its centre: the lever of friction when it turns."""
        if self.radius_m:
            return 2.0 / 3.0 * self.radius_m
        side = sides_of(self.corners_m)
        angle = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
        towards = np.stack([np.cos(angle), np.sin(angle)], axis=1) @ side[:, 2:4].T
        rim = np.where(towards > 0.0, side[:, 4] / np.maximum(towards, 1e-12), np.inf).min(axis=1)
        return float(2.0 / 3.0 * (rim**3).mean() / (rim**2).mean())


def load_of(obstacle: Obstacle) -> Load:
    """The physics' view of a movable obstacle."""
    assert obstacle.mass_kg is not None
    if obstacle.shape == "cylinder":
        at = obstacle.x_m, obstacle.y_m, 0.0
        return Load(obstacle.mass_kg, obstacle.radius_m, np.empty((0, 2)), (0.0, 0.0), *at)
    corners = replace(obstacle, x_m=0.0, y_m=0.0, heading_rad=0.0).corners_m
    cx, cy = _centroid(corners)
    c, s = np.cos(obstacle.heading_rad), np.sin(obstacle.heading_rad)
    x, y = obstacle.x_m + (c * cx - s * cy), obstacle.y_m + (s * cx + c * cy)
    return Load(obstacle.mass_kg, 0.0, corners - np.array([cx, cy]), (cx, cy), x, y, obstacle.heading_rad)


def _centroid(corners: FloatArray) -> tuple[float, float]:
    (x, y), (u, v) = corners.T, np.roll(corners, -1, axis=0).T
    twice = x * v - u * y
    area = 3.0 * twice.sum()
    return float(((x + u) * twice).sum() / area), float(((y + v) * twice).sum() / area)


class Movables:
    """The movable obstacles of all arenas, k in each.

    `pose` is (arenas, k, 3): x, y in m, heading in rad (not wrapped), as an obstacle's table gives them.
    """

    def __init__(self, standing: Sequence[tuple[Obstacle, ...]], obstacles: Obstacles) -> None:
        """Those of these obstacles that are movable, in their order; `obstacles` are the same as arrays."""
        self.loads = [[load_of(obstacle) for obstacle in own if obstacle.movable] for own in standing]
        self.pose = np.array(
            [[(o.x_m, o.y_m, o.heading_rad) for o in own if o.movable] for own in standing], np.float64
        ).reshape(len(standing), -1, 3)
        self._obstacles = obstacles
        round_one, row = _rows(standing, obstacles)
        self._round: BoolArray = np.array(round_one, np.bool_)
        self._row: IntArray = np.array(row, np.int64)
        loads = [load for own in self.loads for load in own]
        self._centre = np.array([load.centre_m for load in loads], np.float64).reshape(-1, 2)
        self._corner = np.zeros((len(obstacles.side), 2))
        for load, is_round, at in zip(loads, round_one, row, strict=True):
            if not is_round:
                self._corner[obstacles.side_start[at] : obstacles.side_start[at + 1]] = load.corners_m

    def move(self, state: FloatArray) -> None:
        """They are where `state` (arenas, k, 3 or more) says: x, y of the centre of mass, heading."""
        _move(state, self._round, self._row, self._centre, self._corner, self._obstacles, self.pose)


def _rows(standing: Sequence[tuple[Obstacle, ...]], obstacles: Obstacles) -> tuple[list[bool], list[int]]:
    """Of each movable obstacle: whether it is a circle, and its row among the circles or the polygons."""
    round_one: list[bool] = []
    row: list[int] = []
    for arena, own in enumerate(standing):
        following = {True: int(obstacles.circle_start[arena]), False: int(obstacles.polygon_start[arena])}
        for obstacle in own:
            is_round = obstacle.shape == "cylinder"
            if obstacle.movable:
                round_one.append(is_round)
                row.append(following[is_round])
            following[is_round] += 1
    return round_one, row


@njit()
def _move(state, is_round, rows, centre, corner, obstacles, pose):
    arenas, per_arena = pose.shape[:2]
    for arena in range(arenas):
        for i in range(per_arena):
            at = arena * per_arena + i
            x, y, heading, row = state[arena, i, 0], state[arena, i, 1], state[arena, i, 2], rows[at]
            c, s = np.cos(heading), np.sin(heading)
            cx, cy = centre[at]
            pose[arena, i] = x - (c * cx - s * cy), y - (s * cx + c * cy), heading
            if is_round[at]:
                obstacles.circle[row, 0], obstacles.circle[row, 1] = x, y
                continue
            start, stop = obstacles.side_start[row], obstacles.side_start[row + 1]
            turned = np.empty((stop - start, 2))
            turned[:, 0] = x + c * corner[start:stop, 0] - s * corner[start:stop, 1]
            turned[:, 1] = y + s * corner[start:stop, 0] + c * corner[start:stop, 1]
            obstacles.side[start:stop] = sides_of(turned)
            obstacles.polygon[row, 0], obstacles.polygon[row, 1] = turned[:, 0].mean(), turned[:, 1].mean()
