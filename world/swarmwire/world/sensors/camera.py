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

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.geometry.obstacle_index import obstacles_near
from swarmwire.comms.base.geometry.robot_index import sort
from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.robot.sensors.camera import CameraSpec
from swarmwire.comms.robot.sensors.sensor import Field
from swarmwire.world.sensors.rays import near_robots, nearest, obstacle_indices_of, robot_index_of
from swarmwire.world.sensors.sensor import BuiltInSensor

NEVER = (np.inf, -np.inf)
END = 1.0 - 1e-6  # share of the way: the body that carries a LED does not hide it


class SightLine(NamedTuple):
    """A line from an eye to its target, in m; the point at the share t of the way is x + t dx, and so on."""

    x: float
    y: float
    z: float
    dx: float
    dy: float
    dz: float


@kernel()
def through_disc(line, cx, cy, radius):
    """The shares of the way, extended, between which the line is above or below a disc; inf, -inf if it misses it."""
    ox, oy = cx - line.x, cy - line.y
    length2 = line.dx * line.dx + line.dy * line.dy
    apart2 = ox * ox + oy * oy - radius * radius
    if length2 == 0.0:
        return (-np.inf, np.inf) if apart2 < 0.0 else NEVER
    along = ox * line.dx + oy * line.dy
    root2 = along * along - length2 * apart2
    if root2 <= 0.0:
        return NEVER
    root = np.sqrt(root2)
    return (along - root) / length2, (along + root) / length2


@kernel()
def through_polygon(line, obstacles, k):
    """As `through_disc`, for polygon k."""
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
    """Whether the line, before its end, passes between two heights within these shares of the way."""
    first, last = max(enter, 0.0), min(leave, END)
    if first >= last:
        return False
    one, other = line.z + first * line.dz, line.z + last * line.dz
    return min(one, other) < top_m and max(one, other) > bottom_m


class Mirror(NamedTuple):
    """The spec of a camera for kernels, and a buffer."""

    first: int  # robot index of the group's first robot
    height_m: float  # above the body's lower side
    reach_m: float
    overhang_m: float  # the greatest distance of a LED from the rim of its body
    nearby: IntArray  # (obstacles,) buffer


class CameraSensor(BuiltInSensor[CameraSpec]):
    """Sensor `camera`: distance_m (from the body's centre, with normal noise), bearing_rad and colour of each blob."""

    @property
    def fields(self) -> tuple[Field, ...]:
        """As the spec declares them, with the range at the body's altitude."""
        distance, *others = self.spec.reading_fields()
        return replace(distance, high=self.spec.reach_m(self.group.body.altitude_m)), *others

    def start(self) -> None:
        """Index what the camera may see."""
        scene, group, spec = self.scene, self.group, self.spec
        reach_m = spec.reach_m(group.body.altitude_m)
        self._shape = len(scene.keys), group.stop - group.start, spec.max_blobs
        ring_m = np.hypot(scene.led_positions_m[..., 0], scene.led_positions_m[..., 1])
        overhang_m = float(np.max(ring_m - scene.radius_m[:, None], initial=0.0))
        self._robots = robot_index_of(scene, reach_m + overhang_m + float(scene.radius_m.max()))
        self._obstacles = obstacle_indices_of(scene, reach_m)
        nearby = np.empty(len(self._obstacles.now().shape), np.int64)
        self._mirror = Mirror(group.start, spec.height_m, reach_m, overhang_m, nearby)

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """The blobs that every robot of the group sees."""
        blobs = tuple(np.full(self._shape, np.nan) for _ in range(3))
        scene = self.scene
        _watch(blobs, self._robots, self._obstacles.now(), self._mirror, scene.leds, scene.led_positions_m)
        return blobs


@kernel(from_python=True)
def _watch(blobs, robots, obstacles, mirror, leds, places):
    """Set distance, bearing and colour (arenas, n, blobs each)."""
    sort(robots.cells, robots.state, robots.running)
    for arena in range(blobs[0].shape[0]):
        if not robots.running[arena]:
            continue
        for i in range(blobs[0].shape[1]):
            own = mirror.first + i
            x = nearest(0.0, robots.state[arena, own, 0], robots.wrap_x, robots.per_wrap_x)
            y = nearest(0.0, robots.state[arena, own, 1], robots.wrap_y, robots.per_wrap_y)
            eye_z = robots.bottom_m[own] + mirror.height_m
            robot_count = near_robots(robots, arena, own, x, y, mirror.reach_m + mirror.overhang_m, -np.inf, np.inf)
            if robot_count == 0:
                continue
            obstacle_count = obstacles_near(mirror.nearby, obstacles, arena, x, y, mirror.reach_m, 0.0)
            eye = x, y, eye_z, robots.state[arena, own, 2]
            _list_blobs(blobs, arena, i, eye, robots, robot_count, obstacles, obstacle_count, mirror, leds, places)


@kernel()
def _list_blobs(blobs, arena, i, eye, robots, robot_count, obstacles, obstacle_count, mirror, leds, places):
    """Set the blobs of one row: the lit LEDs in sight on the nearby robots."""
    x, y, eye_z, heading = eye
    c, s, count = np.cos(heading), np.sin(heading), 0
    for at in range(robot_count):
        other = robots.nearby[at]
        turn_c, turn_s = np.cos(robots.state[arena, other, 2]), np.sin(robots.state[arena, other, 2])
        for led in range(leds.shape[2]):
            if leds[arena, other, led] == 0:
                continue
            ahead, left, up = places[other, led, 0], places[other, led, 1], places[other, led, 2]
            to_x = robots.nearby_at[at, 0] + turn_c * ahead - turn_s * left - x
            to_y = robots.nearby_at[at, 1] + turn_s * ahead + turn_c * left - y
            z, apart = robots.bottom_m[other] + up, np.sqrt(to_x * to_x + to_y * to_y)
            if apart > mirror.reach_m or z >= eye_z:
                continue
            line = SightLine(x, y, eye_z, to_x, to_y, z - eye_z)
            if not _is_hidden(line, robots, robot_count, obstacles, mirror.nearby, obstacle_count):
                bearing = np.arctan2(c * to_y - s * to_x, c * to_x + s * to_y)
                count = _keep(blobs, arena, i, count, apart, bearing, leds[arena, other, led])


@kernel()
def _is_hidden(line, robots, robot_count, obstacles, nearby, obstacle_count):
    for at in range(robot_count):
        other = robots.nearby[at]
        enter, leave = through_disc(line, robots.nearby_at[at, 0], robots.nearby_at[at, 1], robots.radius_m[other])
        if is_blocked(line, enter, leave, robots.bottom_m[other], robots.top_m[other]):
            return True
    for at in range(obstacle_count):
        k = nearby[at]
        if obstacles.side_start[k] == obstacles.side_start[k + 1]:
            enter, leave = through_disc(line, obstacles.shape[k, 0], obstacles.shape[k, 1], obstacles.shape[k, 2])
        else:
            enter, leave = through_polygon(line, obstacles, k)
        if is_blocked(line, enter, leave, 0.0, obstacles.shape[k, 3]):
            return True
    return False


@kernel()
def _keep(blobs, arena, i, count, apart, bearing, colour):
    """Insert a blob by distance if there is room; returns the number of blobs."""
    distances, bearings, colours = blobs[0][arena, i], blobs[1][arena, i], blobs[2][arena, i]
    if count == len(distances):
        if apart >= distances[count - 1]:
            return count
        count -= 1
    at = count
    while at > 0 and apart < distances[at - 1]:
        distances[at], bearings[at], colours[at] = distances[at - 1], bearings[at - 1], colours[at - 1]
        at -= 1
    distances[at], bearings[at], colours[at] = apart, bearing, float(colour)
    return count + 1
