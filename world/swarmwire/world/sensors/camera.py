"""The omnidirectional camera, and lines of sight in space. Compiled.

A mirror at height h with the aperture a sees the floor within h tan a (ARGoS 3,
`colored_blob_omnidirectional_camera`). The camera sees a LED within that distance if the LED is lower than the mirror
and the straight line to it, in space, passes through no obstacle and no body except the camera's own. So it may see a
far LED above a low body.
"""

# pyright: basic, reportUnknownMemberType=false

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from swarmwire.comms.base import math as portable
from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.geometry.obstacle_index import ObstacleIndex, obstacles_near
from swarmwire.comms.base.geometry.robot_index import sort
from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.base.math import compiled as math_compiled
from swarmwire.comms.robot.sensors.camera import CameraSpec
from swarmwire.comms.robot.sensors.sensor import Field
from swarmwire.world.sensors.rays import RobotIndex, near_robots, nearest, obstacle_indices_of, robot_index_of
from swarmwire.world.sensors.sensor import BuiltInSensor

NEVER = (np.inf, -np.inf)
END = 1.0 - 1e-6  # share of the line that bodies may block: the body that carries a LED does not hide it


class SightLine(NamedTuple):
    """A line from an eye to its target, in m; the point at the share t of the line is x + t dx, y + t dy, z + t dz."""

    x: float
    y: float
    z: float
    dx: float
    dy: float
    dz: float


@kernel()
def through_disc(line, cx, cy, radius):
    """Return the shares of the extended line between which it is above or below a disc; inf, -inf if it misses."""
    ox, oy = cx - line.x, cy - line.y
    length2 = line.dx * line.dx + line.dy * line.dy
    outside2 = ox * ox + oy * oy - radius * radius
    if length2 == 0.0:
        return (-np.inf, np.inf) if outside2 < 0.0 else NEVER
    along = ox * line.dx + oy * line.dy
    root2 = along * along - length2 * outside2
    if root2 <= 0.0:
        return NEVER
    root = np.sqrt(root2)
    return (along - root) / length2, (along + root) / length2


@kernel()
def through_polygon(line, obstacles, k):
    """Return the shares of the extended line between which it is above or below polygon k; see `through_disc`."""
    enter, leave = -np.inf, np.inf
    for i in range(obstacles.side_start[k], obstacles.side_start[k + 1]):
        nx, ny = obstacles.side[i, 2], obstacles.side[i, 3]
        outside = nx * line.x + ny * line.y - obstacles.side[i, 4]
        speed = nx * line.dx + ny * line.dy
        if speed == 0.0:
            if outside >= 0.0:
                return NEVER
        elif speed < 0.0:
            enter = max(enter, -outside / speed)
        else:
            leave = min(leave, -outside / speed)
    return enter, leave


@kernel()
def is_blocked(line, enter, leave, bottom_m, top_m):
    """Return True if the line, before its end, passes between two heights within these shares."""
    first, last = max(enter, 0.0), min(leave, END)
    if first >= last:
        return False
    first_z, last_z = line.z + first * line.dz, line.z + last * line.dz
    return min(first_z, last_z) < top_m and max(first_z, last_z) > bottom_m


class Mirror(NamedTuple):
    """The spec of a camera for kernels, and a buffer."""

    first: int  # robot index of the group's first robot
    height_m: float  # above the body's lower side
    reach_m: float
    overhang_m: float  # the greatest distance of a LED from the rim of its body
    nearby: IntArray  # (obstacles,) buffer


class LedArrays(NamedTuple):
    """The LEDs of all robots; see `Scene`."""

    rgb: IntArray  # (arenas, robots, LEDs)
    position_m: FloatArray  # (robots, LEDs, 3)


class Nearby(NamedTuple):
    """The robots and obstacles near a camera; the counts are those of the filled buffers."""

    robots: RobotIndex
    robot_count: int
    obstacles: ObstacleIndex
    nearby_obstacles: IntArray
    obstacle_count: int


class CameraSensor(BuiltInSensor[CameraSpec]):
    """Sensor `camera`: distance_m (from the body's centre, with normal noise), bearing_rad and colour of each blob."""

    @property
    def fields(self) -> tuple[Field, ...]:
        """The fields of the spec, with the range at the body's altitude."""
        distance, *others = self.spec.reading_fields()
        return replace(distance, high=self.spec.reach_m(self.group.body.altitude_m)), *others

    def start(self) -> None:
        """Index the bodies and obstacles that the camera may see."""
        scene, group, spec = self.scene, self.group, self.spec
        reach_m = spec.reach_m(group.body.altitude_m)
        self._shape = len(scene.keys), group.stop - group.start, spec.max_blobs
        led_radius_m = portable.hypot(scene.led_positions_m[..., 0], scene.led_positions_m[..., 1])
        overhang_m = float(np.max(led_radius_m - scene.radius_m[:, None], initial=0.0))
        self._robots = robot_index_of(scene, reach_m + overhang_m + float(scene.radius_m.max()))
        self._obstacles = obstacle_indices_of(scene, reach_m)
        nearby = np.empty(len(self._obstacles.now().shape), np.int64)
        self._mirror = Mirror(group.start, spec.height_m, reach_m, overhang_m, nearby)
        self._leds = LedArrays(scene.leds, scene.led_positions_m)

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """Return the blobs that every robot of the group sees."""
        blobs = tuple(np.full(self._shape, np.nan) for _ in range(3))
        _fill_blobs(blobs, self._robots, self._obstacles.now(), self._mirror, self._leds)
        return blobs


@kernel(from_python=True)
def _fill_blobs(blobs, robots, obstacles, mirror, leds):
    """Set distance, bearing and colour (arenas, n, blobs each)."""
    sort(robots.cells, robots.state, robots.running)
    for arena in range(blobs[0].shape[0]):
        if not robots.running[arena]:
            continue
        for i in range(blobs[0].shape[1]):
            robot = mirror.first + i
            x = nearest(0.0, robots.state[arena, robot, 0], robots.wrap_x, robots.per_wrap_x)
            y = nearest(0.0, robots.state[arena, robot, 1], robots.wrap_y, robots.per_wrap_y)
            eye_z = robots.bottom_m[robot] + mirror.height_m
            robot_count = near_robots(robots, arena, robot, x, y, mirror.reach_m + mirror.overhang_m, -np.inf, np.inf)
            if robot_count == 0:
                continue
            obstacle_count = obstacles_near(mirror.nearby, obstacles, arena, x, y, mirror.reach_m, 0.0)
            nearby = Nearby(robots, robot_count, obstacles, mirror.nearby, obstacle_count)
            eye = x, y, eye_z, robots.state[arena, robot, 2]
            _list_blobs(blobs, arena, i, eye, nearby, mirror.reach_m, leds)


@kernel()
def _list_blobs(blobs, arena, i, eye, nearby, reach_m, leds):
    """Set the blobs of one row: the lit LEDs in sight on the nearby robots."""
    robots = nearby.robots
    x, y, eye_z, heading = eye
    c, s, count = math_compiled.cos(heading), math_compiled.sin(heading), 0
    for k in range(nearby.robot_count):
        other = robots.nearby[k]
        turn_c, turn_s = (
            math_compiled.cos(robots.state[arena, other, 2]),
            math_compiled.sin(robots.state[arena, other, 2]),
        )
        for led in range(leds.rgb.shape[2]):
            colour = leds.rgb[arena, other, led]
            if colour == 0:
                continue
            position_m = leds.position_m[other, led]
            ahead, left, up = position_m[0], position_m[1], position_m[2]
            to_x = robots.nearby_xy[k, 0] + turn_c * ahead - turn_s * left - x
            to_y = robots.nearby_xy[k, 1] + turn_s * ahead + turn_c * left - y
            z, distance = robots.bottom_m[other] + up, np.sqrt(to_x * to_x + to_y * to_y)
            if distance > reach_m or z >= eye_z:
                continue
            line = SightLine(x, y, eye_z, to_x, to_y, z - eye_z)
            if not _is_hidden(line, nearby):
                bearing = math_compiled.atan2(c * to_y - s * to_x, c * to_x + s * to_y)
                count = _insert(blobs, arena, i, count, distance, bearing, colour)


@kernel()
def _is_hidden(line, nearby):
    robots, obstacles = nearby.robots, nearby.obstacles
    for k in range(nearby.robot_count):
        other = robots.nearby[k]
        enter, leave = through_disc(line, robots.nearby_xy[k, 0], robots.nearby_xy[k, 1], robots.radius_m[other])
        if is_blocked(line, enter, leave, robots.bottom_m[other], robots.top_m[other]):
            return True
    for k in nearby.nearby_obstacles[: nearby.obstacle_count]:
        if obstacles.side_start[k] == obstacles.side_start[k + 1]:
            enter, leave = through_disc(line, obstacles.shape[k, 0], obstacles.shape[k, 1], obstacles.shape[k, 2])
        else:
            enter, leave = through_polygon(line, obstacles, k)
        if is_blocked(line, enter, leave, 0.0, obstacles.shape[k, 3]):
            return True
    return False


@kernel()
def _insert(blobs, arena, i, count, distance, bearing, colour):
    """Insert a blob by distance if there is room, and return the number of blobs."""
    distances, bearings, colours = blobs[0][arena, i], blobs[1][arena, i], blobs[2][arena, i]
    if count == len(distances):
        if distance >= distances[count - 1]:
            return count
        count -= 1
    k = count
    while k > 0 and distance < distances[k - 1]:
        distances[k], bearings[k], colours[k] = distances[k - 1], bearings[k - 1], colours[k - 1]
        k -= 1
    distances[k], bearings[k], colours[k] = distance, bearing, float(colour)
    return count + 1
