"""Straight lines in space, and the upright bodies that they pass through. Compiled."""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.bodies.sensor_specs import CameraSpec
from swarmwire.comms.geometry.obstacle_index import obstacles_near
from swarmwire.comms.geometry.robot_index import sort
from swarmwire.comms.kernels import kernel
from swarmwire.comms.truth import Group
from swarmwire.world.sensors.rays import ObstacleIndices, near_robots, nearest, robot_index_of
from swarmwire.world.sensors.sensor import Field, Noise, Scene

NEVER = (np.inf, -np.inf)
END = 1.0 - 1e-6  # a LED on the skin of a body is not hidden by what it sits on


class SightLine(NamedTuple):
    """A line from an eye to what it looks at, in m; a share t of the way is at x + t dx and so on."""

    x: float
    y: float
    z: float
    dx: float
    dy: float
    dz: float


@kernel()
def through_disc(line, cx, cy, radius):
    """Between which shares of the way, prolonged, the line is above or below a disc; inf, -inf if it misses it."""
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
def through_polygon(line, things, k):
    """As `through_disc`, for polygon k."""
    enter, leave = -np.inf, np.inf
    for i in range(things.side_start[k], things.side_start[k + 1]):
        nx, ny = things.side[i, 2], things.side[i, 3]
        outside = nx * line.x + ny * line.y - things.side[i, 4]
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
def is_cut(line, enter, leave, bottom_m, top_m):
    """Whether the line, before it arrives, passes between two heights while it is between these shares of the way."""
    first, last = max(enter, 0.0), min(leave, END)
    if first >= last:
        return False
    one, other = line.z + first * line.dz, line.z + last * line.dz
    return min(one, other) < top_m and max(one, other) > bottom_m


# --- Omnidirectional camera: LEDs of other robots within its cone that nothing hides from its mirror. Compiled.
#
# A mirror at height h with the aperture a sees the floor within h tan a (ARGoS 3,
# `colored_blob_omnidirectional_camera`). A LED within that distance is seen if it is lower than the mirror and the
# straight line to it, in space, passes through no obstacle and no body but the camera's own: a far LED may well be seen
# above a low body.


class Mirror(NamedTuple):
    """The sheet as kernels take it."""

    first: int  # robot of the group
    height_m: float  # above the body's lower side
    reach_m: float
    overhang_m: float  # how far a LED may stand out of its body
    found: IntArray  # (things,)


class CameraSensor:
    """Sense `camera`: distance_m (from the body's centre, with normal noise), bearing_rad and colour of each blob."""

    def __init__(self, scene: Scene, group: Group, spec: CameraSpec) -> None:
        blobs, noise = spec.most_blobs, Noise("normal", 0.0, spec.noise_relative)
        reach_m = spec.reach_m(group.body.altitude_m)
        self.fields = (
            Field("distance_m", blobs, noise, spec.step, low=0.0, high=reach_m),
            Field("bearing_rad", blobs, angle=True),
            Field("colour", blobs),
        )
        self._scene, self._shape = scene, (len(scene.keys), group.stop - group.start, blobs)
        ring_m = np.hypot(scene.led_places_m[..., 0], scene.led_places_m[..., 1])
        overhang_m = float(np.max(ring_m - scene.radius_m[:, None], initial=0.0))
        self._crowd = robot_index_of(scene, reach_m + overhang_m + float(scene.radius_m.max()))
        self._standing = ObstacleIndices(scene, reach_m)
        found = np.empty(len(self._standing.now().shape), np.int64)
        self._mirror = Mirror(group.start, spec.height_m, reach_m, overhang_m, found)

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """The blobs that every robot of the group sees."""
        blobs = tuple(np.full(self._shape, np.nan) for _ in range(3))
        scene = self._scene
        _watch(blobs, self._crowd, self._standing.now(), self._mirror, scene.leds, scene.led_places_m)
        return blobs


@kernel(from_python=True)
def _watch(blobs, crowd, things, mirror, leds, places):
    """Set distance, bearing and colour (arenas, n, blobs each)."""
    sort(crowd.cells, crowd.state, crowd.running)
    for arena in range(blobs[0].shape[0]):
        if not crowd.running[arena]:
            continue
        for i in range(blobs[0].shape[1]):
            own = mirror.first + i
            x = nearest(0.0, crowd.state[arena, own, 0], crowd.wrap_x, crowd.per_wrap_x)
            y = nearest(0.0, crowd.state[arena, own, 1], crowd.wrap_y, crowd.per_wrap_y)
            eye_z = crowd.bottom_m[own] + mirror.height_m
            robots = near_robots(crowd, arena, own, x, y, mirror.reach_m + mirror.overhang_m, -np.inf, np.inf)
            if robots == 0:
                continue
            obstacles = obstacles_near(mirror.found, things, arena, x, y, mirror.reach_m, 0.0)
            eye = x, y, eye_z, crowd.state[arena, own, 2]
            _tell(blobs, arena, i, eye, crowd, robots, things, obstacles, mirror, leds, places)


@kernel()
def _tell(blobs, arena, i, eye, crowd, robots, things, obstacles, mirror, leds, places):
    """Set the blobs of one row: the lit LEDs in sight of the robots that were found."""
    x, y, eye_z, heading = eye
    c, s, count = np.cos(heading), np.sin(heading), 0
    for at in range(robots):
        other = crowd.found[at]
        turn_c, turn_s = np.cos(crowd.state[arena, other, 2]), np.sin(crowd.state[arena, other, 2])
        for led in range(leds.shape[2]):
            if leds[arena, other, led] == 0:
                continue
            ahead, left, up = places[other, led, 0], places[other, led, 1], places[other, led, 2]
            to_x = crowd.found_at[at, 0] + turn_c * ahead - turn_s * left - x
            to_y = crowd.found_at[at, 1] + turn_s * ahead + turn_c * left - y
            z, apart = crowd.bottom_m[other] + up, np.sqrt(to_x * to_x + to_y * to_y)
            if apart > mirror.reach_m or z >= eye_z:
                continue
            line = SightLine(x, y, eye_z, to_x, to_y, z - eye_z)
            if not _is_hidden(line, crowd, robots, things, mirror.found, obstacles):
                bearing = np.arctan2(c * to_y - s * to_x, c * to_x + s * to_y)
                count = _keep(blobs, arena, i, count, apart, bearing, leds[arena, other, led])


@kernel()
def _is_hidden(line, crowd, robots, things, found, obstacles):
    for at in range(robots):
        other = crowd.found[at]
        enter, leave = through_disc(line, crowd.found_at[at, 0], crowd.found_at[at, 1], crowd.radius_m[other])
        if is_cut(line, enter, leave, crowd.bottom_m[other], crowd.top_m[other]):
            return True
    for at in range(obstacles):
        k = found[at]
        if things.side_start[k] == things.side_start[k + 1]:
            enter, leave = through_disc(line, things.shape[k, 0], things.shape[k, 1], things.shape[k, 2])
        else:
            enter, leave = through_polygon(line, things, k)
        if is_cut(line, enter, leave, 0.0, things.shape[k, 3]):
            return True
    return False


@kernel()
def _keep(blobs, arena, i, count, apart, bearing, colour):
    """Put a blob in its place by distance, as long as there is room; how many there are then."""
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
