"""Laser scan: many rays from one origin. Each near thing is tested only against the rays that may meet it. Compiled."""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.geometry.obstacle_index import obstacles_near
from swarmwire.comms.base.geometry.obstacles import ray_to_circle, ray_to_polygon
from swarmwire.comms.base.geometry.robot_index import sort
from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.robot.sensors.scan import ScanSpec
from swarmwire.world.sensors.rays import near_robots, nearest, obstacle_indices_of, robot_index_of
from swarmwire.world.sensors.sensor import BuiltInSensor

TURN_RAD = 2.0 * np.pi
SLACK = 1e-6  # of the angle between two rays: a ray that grazes a thing is tested, despite rounding


class Laser(NamedTuple):
    """The spec of a scanner for kernels, and buffers for one robot."""

    first: int  # robot index of the group's first robot
    cos: FloatArray  # (rays,) directions in the body's frame
    sin: FloatArray  # (rays,)
    first_rad: float
    step_rad: float
    range_m: float
    at_m: float
    half_x: float  # of the walls, in m; inf: no walls
    half_y: float
    dx: FloatArray  # (rays,) directions in the arena's frame
    dy: FloatArray  # (rays,)
    nearby: IntArray  # (obstacles,) buffer


class ScanSensor(BuiltInSensor[ScanSpec]):
    """Sensor `scan`: range_m (n, rays) from the scanner, inf where nothing is within its range. Noise is normal."""

    def start(self) -> None:
        """Index what the rays may meet."""
        scene, group, spec = self.scene, self.group, self.spec
        self._shape = len(scene.keys), group.stop - group.start, spec.rays
        self._robots = robot_index_of(scene, spec.range_m + float(scene.radius_m.max()))
        self._obstacles = obstacle_indices_of(scene, spec.range_m)
        walled, (width, height) = scene.boundary == "walls", scene.size_m
        self._laser = Laser(
            group.start,
            *spec.direction,
            np.deg2rad(spec.first_deg),
            spec.step_rad,
            spec.range_m,
            spec.at_m,
            0.5 * width if walled else np.inf,
            0.5 * height if walled else np.inf,
            np.empty(spec.rays),
            np.empty(spec.rays),
            np.empty(len(self._obstacles.now().shape), np.int64),
        )

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """The distance along every ray of every robot of the group."""
        near = np.empty(self._shape)
        _scan(near, self._robots, self._obstacles.now(), self._laser)
        return (near,)


@kernel(from_python=True)
def _scan(near, robots, obstacles, laser):
    """Set near (arenas, n, rays)."""
    sort(robots.cells, robots.state, robots.running)
    for arena in range(near.shape[0]):
        if not robots.running[arena]:
            continue
        for i in range(near.shape[1]):
            own, rays = laser.first + i, near[arena, i]
            heading = robots.state[arena, own, 2]
            c, s, low, high = np.cos(heading), np.sin(heading), robots.bottom_m[own], robots.top_m[own]
            x = robots.state[arena, own, 0] + laser.at_m * c
            y = robots.state[arena, own, 1] + laser.at_m * s
            x = nearest(0.0, x, robots.wrap_x, robots.per_wrap_x)
            y = nearest(0.0, y, robots.wrap_y, robots.per_wrap_y)
            for ray in range(len(rays)):
                laser.dx[ray] = c * laser.cos[ray] - s * laser.sin[ray]
                laser.dy[ray] = s * laser.cos[ray] + c * laser.sin[ray]
                rays[ray] = np.inf
            _meet_walls(rays, x, y, laser)
            for at in range(obstacles_near(laser.nearby, obstacles, arena, x, y, laser.range_m, low)):
                k = laser.nearby[at]
                if obstacles.side_start[k] == obstacles.side_start[k + 1]:
                    _meet_disc(
                        rays, x, y, heading, laser, obstacles.shape[k, 0], obstacles.shape[k, 1], obstacles.shape[k, 2]
                    )
                else:
                    _meet_polygon(rays, x, y, heading, laser, obstacles, k)
            for at in range(near_robots(robots, arena, own, x, y, laser.range_m, low, high)):
                radius = robots.radius_m[robots.nearby[at]]
                _meet_disc(rays, x, y, heading, laser, robots.nearby_at[at, 0], robots.nearby_at[at, 1], radius)
            for ray in range(len(rays)):
                if rays[ray] > laser.range_m:
                    rays[ray] = np.inf


@kernel()
def _meet_walls(rays, x, y, laser):
    if abs(x) + laser.range_m >= laser.half_x:
        for ray in range(len(rays)):
            step = laser.dx[ray]
            if step != 0.0:
                rays[ray] = max((np.copysign(laser.half_x, step) - x) / step, 0.0)
    if abs(y) + laser.range_m >= laser.half_y:
        for ray in range(len(rays)):
            step = laser.dy[ray]
            if step != 0.0:
                rays[ray] = min(rays[ray], max((np.copysign(laser.half_y, step) - y) / step, 0.0))


@kernel()
def _meet_disc(rays, x, y, heading, laser, cx, cy, radius):
    ox, oy = cx - x, cy - y
    apart = np.sqrt(ox * ox + oy * oy)
    right, width = 0.0, TURN_RAD
    if apart > radius:
        half = np.arcsin(radius / apart)
        right, width = np.arctan2(oy, ox) - half, 2.0 * half
    for past_last in range(2):
        first, stop = _span(right - heading, width, past_last, laser)
        for ray in range(first, stop):
            rays[ray] = min(rays[ray], ray_to_circle(x, y, laser.dx[ray], laser.dy[ray], cx, cy, radius))


@kernel()
def _meet_polygon(rays, x, y, heading, laser, obstacles, k):
    right, width = _seen(x, y, obstacles, k)
    for past_last in range(2):
        first, stop = _span(right - heading, width, past_last, laser)
        for ray in range(first, stop):
            rays[ray] = min(rays[ray], ray_to_polygon(x, y, laser.dx[ray], laser.dy[ray], obstacles, k))


@kernel()
def _span(right, width, past_last, laser):
    """The rays from the angle `right` in the body's frame on that a thing of this width may meet, as a range.

    They may go on at ray 0: those are the ones `past_last`.
    """
    per_turn = TURN_RAD / laser.step_rad
    first = (right - laser.first_rad) / laser.step_rad
    first -= per_turn * (np.floor(first / per_turn) + past_last)
    last = first + width / laser.step_rad
    return max(int(np.ceil(first - SLACK)), 0), min(int(np.floor(last + SLACK)) + 1, len(laser.dx))


@kernel()
def _seen(x, y, obstacles, k):
    """The direction of the rightmost corner of a polygon, and how wide it looks; all around from inside."""
    begin, end = obstacles.side_start[k], obstacles.side_start[k + 1]
    outside = False
    right_x, right_y = obstacles.side[begin, 0] - x, obstacles.side[begin, 1] - y
    left_x, left_y = right_x, right_y
    for i in range(begin, end):
        outside = outside or obstacles.side[i, 2] * x + obstacles.side[i, 3] * y > obstacles.side[i, 4]
        cx, cy = obstacles.side[i, 0] - x, obstacles.side[i, 1] - y
        if right_x * cy - right_y * cx < 0.0:
            right_x, right_y = cx, cy
        if left_x * cy - left_y * cx > 0.0:
            left_x, left_y = cx, cy
    if not outside:
        return 0.0, TURN_RAD
    width = np.arctan2(right_x * left_y - right_y * left_x, right_x * left_x + right_y * left_y)
    return np.arctan2(right_y, right_x), abs(width)
