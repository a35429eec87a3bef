"""Proximity: rays from the rim that end at the nearest robot, obstacle or wall, seen through the sensor's response."""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np
from numba import njit

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.geometry import ray_to_circle, ray_to_polygon
from swarmwire.comms.grid import build, cell_of
from swarmwire.comms.sheets import Proximity
from swarmwire.comms.truth import Group
from swarmwire.world.sensors.scene import Scene
from swarmwire.world.sensors.sensor import Field, Noise


class Eyes(NamedTuple):
    """The sheet as kernels take it."""

    cos: FloatArray  # (rays,) directions in the body's frame
    sin: FloatArray  # (rays,)
    range_m: float
    rational: bool  # form of the response; `ResponseCurve` says what the numbers mean
    a: float
    b: float
    c: float
    full_m: float
    reach_m: float


class ProximitySensor:
    """Sense `proximity`: value (n, rays), the sensors' answers, 0 to 1. Noise is uniform, and new in every reading."""

    def __init__(self, scene: Scene, group: Group, sheet: Proximity) -> None:
        self._scene, self._group, curve = scene, group, sheet.response
        direction = np.cos(sheet.angle_rad), np.sin(sheet.angle_rad)
        numbers = curve.a, curve.b, curve.c, curve.full_m, curve.reach_m
        self._eyes = Eyes(*direction, sheet.range_m, curve.kind == "rational", *numbers)
        noise = Noise("uniform", sheet.noise)
        self.fields = (Field("value", len(sheet.angle_rad), noise, sheet.step, low=0.0, high=1.0, blank=0.0),)
        self._reach_m = group.body.radius_m + sheet.range_m + float(scene.radius_m.max())

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """What every ray of every robot of the group would answer without noise."""
        near = self.distance_m()
        _answer(near, self._eyes)
        return (near,)

    def distance_m(self) -> FloatArray:
        """The true distance along each ray, (arenas, n, rays) in m; inf where nothing is within the range."""
        scene, group = self._scene, self._group
        x, y = scene.state[:, :, 0].ravel(), scene.state[:, :, 1].ravel()
        grid = build(x, y, len(scene.keys), scene.size_m, self._reach_m)
        half = (0.5 * scene.size_m[0], 0.5 * scene.size_m[1]) if scene.walled else (np.inf, np.inf)
        near = np.full((len(scene.keys), group.stop - group.start, len(self._eyes.cos)), np.inf)
        _look(near, scene.state, group.start, scene.radius_m, self._eyes, grid, scene.obstacles, half)
        return near


@njit(cache=True)
def _look(near, state, start, radius, eyes, grid, obstacles, half):
    """Set near (arenas, n, rays): distance from the rim to the first thing on each ray, inf beyond the range."""
    dx, dy = np.empty(len(eyes.cos)), np.empty(len(eyes.cos))
    for arena in range(near.shape[0]):
        for i in range(near.shape[1]):
            own = start + i
            x, y, rim = state[arena, own, 0], state[arena, own, 1], radius[own]
            c, s = np.cos(state[arena, own, 2]), np.sin(state[arena, own, 2])
            for ray in range(len(dx)):
                dx[ray] = c * eyes.cos[ray] - s * eyes.sin[ray]
                dy[ray] = s * eyes.cos[ray] + c * eyes.sin[ray]
            rays = near[arena, i]
            _meet_walls(rays, x, y, rim, dx, dy, eyes.range_m, half)
            _meet_obstacles(rays, x, y, rim, dx, dy, eyes.range_m, obstacles, arena)
            _meet_robots(rays, x, y, rim, dx, dy, eyes.range_m, state[arena], radius, grid, arena, own)
            for ray in range(len(dx)):
                if rays[ray] > eyes.range_m:
                    rays[ray] = np.inf


@njit(cache=True)
def _meet_walls(rays, x, y, rim, dx, dy, range_m, half):
    reach = rim + range_m
    if abs(x) + reach < half[0] and abs(y) + reach < half[1]:
        return
    for ray in range(len(rays)):
        for at, step, end in ((x, dx[ray], half[0]), (y, dy[ray], half[1])):
            if step != 0.0:
                wall = end if step > 0.0 else -end
                rays[ray] = min(rays[ray], max((wall - at - rim * step) / step, 0.0))


@njit(cache=True)
def _meet_obstacles(rays, x, y, rim, dx, dy, range_m, obstacles, arena):
    for k in range(obstacles.circle_start[arena], obstacles.circle_start[arena + 1]):
        circle = obstacles.circle[k]
        _meet_circle(rays, x, y, rim, dx, dy, range_m, circle[0], circle[1], circle[2])
    for k in range(obstacles.polygon_start[arena], obstacles.polygon_start[arena + 1]):
        around = obstacles.polygon[k]
        reach = rim + range_m + around[2]
        ox, oy = around[0] - x, around[1] - y
        if ox * ox + oy * oy < reach * reach:
            for ray in range(len(rays)):
                px, py = x + rim * dx[ray], y + rim * dy[ray]
                rays[ray] = min(rays[ray], ray_to_polygon(px, py, dx[ray], dy[ray], obstacles, k))


@njit(cache=True)
def _meet_robots(rays, x, y, rim, dx, dy, range_m, state, radius, grid, arena, own):
    robots = len(radius)
    column = cell_of(x, grid.left_m, grid.cell_m, grid.nx)
    row = cell_of(y, grid.bottom_m, grid.cell_m, grid.ny)
    for j in range(max(row - 1, 0), min(row + 2, grid.ny)):
        for i in range(max(column - 1, 0), min(column + 2, grid.nx)):
            cell = (arena * grid.ny + j) * grid.nx + i
            for k in range(grid.start[cell], grid.start[cell + 1]):
                other = grid.order[k] - arena * robots
                if other != own:
                    _meet_circle(rays, x, y, rim, dx, dy, range_m, state[other, 0], state[other, 1], radius[other])


@njit(cache=True)
def _meet_circle(rays, x, y, rim, dx, dy, range_m, cx, cy, radius):
    ox, oy, reach = cx - x, cy - y, rim + range_m + radius
    if ox * ox + oy * oy < reach * reach:
        for ray in range(len(rays)):
            px, py = x + rim * dx[ray], y + rim * dy[ray]
            rays[ray] = min(rays[ray], ray_to_circle(px, py, dx[ray], dy[ray], cx, cy, radius))


@njit(cache=True)
def _answer(near, eyes):
    """Replace distances by what the sensors answer to them (`ResponseCurve.value`)."""
    for arena in range(near.shape[0]):
        for i in range(near.shape[1]):
            for ray in range(near.shape[2]):
                d = near[arena, i, ray]
                value = 0.0
                if d <= eyes.reach_m:
                    if not eyes.rational:
                        value = eyes.a * d * d + eyes.b * d + eyes.c
                    elif d < eyes.full_m:
                        value = 1.0
                    else:
                        value = eyes.a / (d + eyes.b)
                near[arena, i, ray] = min(max(value, 0.0), 1.0)
