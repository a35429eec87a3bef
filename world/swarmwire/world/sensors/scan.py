"""Laser scan: many rays from one origin. Each near body is tested only against the rays that may hit it. Compiled."""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.geometry.obstacle_index import obstacles_near
from swarmwire.comms.base.geometry.obstacles import ray_to_circle, ray_to_polygon
from swarmwire.comms.base.geometry.robot_index import sort
from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.base.math import compiled as math_compiled
from swarmwire.comms.robot.sensors.scan import ScanSpec
from swarmwire.world.sensors.rays import near_robots, nearest, obstacle_indices_of, robot_index_of
from swarmwire.world.sensors.sensor import BuiltInSensor

TURN_RAD = 2.0 * np.pi
SLACK = 1e-6  # share of the angle between two rays: a grazing ray is tested, despite rounding


class Laser(NamedTuple):
    """The spec of a scanner for kernels, and buffers for one robot."""

    first: int  # robot index of the group's first robot
    cos: FloatArray  # (rays,) directions in the body's frame
    sin: FloatArray  # (rays,)
    first_rad: float
    step_rad: float
    range_m: float
    offset_m: float  # distance of the scanner ahead of the body's centre
    half_x: float  # distance of the walls from the centre, in m; inf: no walls
    half_y: float
    dx: FloatArray  # (rays,) directions in the arena's frame
    dy: FloatArray  # (rays,)
    nearby: IntArray  # (obstacles,) buffer


class ScanSensor(BuiltInSensor[ScanSpec]):
    """Sensor `scan`: range_m (n, rays) from the scanner, inf where nothing is within its range. Noise is normal."""

    def start(self) -> None:
        """Index the bodies that rays may hit."""
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
        """Return the distance along every ray of every robot of the group."""
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
            robot, rays = laser.first + i, near[arena, i]
            heading = robots.state[arena, robot, 2]
            c, s, low, high = (
                math_compiled.cos(heading),
                math_compiled.sin(heading),
                robots.bottom_m[robot],
                robots.top_m[robot],
            )
            x = robots.state[arena, robot, 0] + laser.offset_m * c
            y = robots.state[arena, robot, 1] + laser.offset_m * s
            x = nearest(0.0, x, robots.wrap_x, robots.per_wrap_x)
            y = nearest(0.0, y, robots.wrap_y, robots.per_wrap_y)
            pose = x, y, heading
            for ray in range(len(rays)):
                laser.dx[ray] = c * laser.cos[ray] - s * laser.sin[ray]
                laser.dy[ray] = s * laser.cos[ray] + c * laser.sin[ray]
                rays[ray] = np.inf
            _hit_walls(rays, x, y, laser)
            for k in laser.nearby[: obstacles_near(laser.nearby, obstacles, arena, x, y, laser.range_m, low)]:
                if obstacles.side_start[k] == obstacles.side_start[k + 1]:
                    _hit_disc(rays, pose, laser, obstacles.shape[k, 0], obstacles.shape[k, 1], obstacles.shape[k, 2])
                else:
                    _hit_polygon(rays, pose, laser, obstacles, k)
            for k in range(near_robots(robots, arena, robot, x, y, laser.range_m, low, high)):
                radius = robots.radius_m[robots.nearby[k]]
                _hit_disc(rays, pose, laser, robots.nearby_xy[k, 0], robots.nearby_xy[k, 1], radius)
            for ray in range(len(rays)):
                if rays[ray] > laser.range_m:
                    rays[ray] = np.inf


@kernel()
def _hit_walls(rays, x, y, laser):
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
def _hit_disc(rays, pose, laser, cx, cy, radius):
    x, y, heading = pose
    ox, oy = cx - x, cy - y
    distance = np.sqrt(ox * ox + oy * oy)
    right, width = 0.0, TURN_RAD
    if distance > radius:
        half = math_compiled.asin(radius / distance)
        right, width = math_compiled.atan2(oy, ox) - half, 2.0 * half
    for past_last in range(2):
        first, stop = _span(right - heading, width, past_last, laser)
        for ray in range(first, stop):
            rays[ray] = min(rays[ray], ray_to_circle(x, y, laser.dx[ray], laser.dy[ray], cx, cy, radius))


@kernel()
def _hit_polygon(rays, pose, laser, obstacles, k):
    x, y, heading = pose
    right, width = _apparent_width(x, y, obstacles, k)
    for past_last in range(2):
        first, stop = _span(right - heading, width, past_last, laser)
        for ray in range(first, stop):
            rays[ray] = min(rays[ray], ray_to_polygon(x, y, laser.dx[ray], laser.dy[ray], obstacles, k))


@kernel()
def _span(right, width, past_last, laser):
    """Return the range of rays that may hit a body of this angular width, from the angle `right` in the body's frame.

    If the width extends beyond the last ray, `past_last` 1 returns the rays from ray 0 on.
    """
    per_turn = TURN_RAD / laser.step_rad
    first = (right - laser.first_rad) / laser.step_rad
    first -= per_turn * (np.floor(first / per_turn) + past_last)
    last = first + width / laser.step_rad
    return max(int(np.ceil(first - SLACK)), 0), min(int(np.floor(last + SLACK)) + 1, len(laser.dx))


@kernel()
def _apparent_width(x, y, obstacles, k):
    """Return the direction of the rightmost corner of a polygon, and its angular width; a full turn from inside."""
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
    width = math_compiled.atan2(right_x * left_y - right_y * left_x, right_x * left_x + right_y * left_y)
    return math_compiled.atan2(right_y, right_x), abs(width)
