"""The camera of emulated e-puck2s: a picture of the scene ahead, drawn column by column.

A ray per column of the picture meets walls, obstacles, lamps and robots; its depth determines the rows that each shape
covers, and the nearest shape is visible. Position and field of view come from Webots' E-puck.proto (0.03 m ahead,
0.028 m above the floor, 0.84 rad), size and format from the firmware: 160 x 120 pixels of RGB565, the high byte first.
There is no noise, and light comes from the camera.
"""

from typing import NamedTuple, TypeVar

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, ByteArray, FloatArray
from swarmwire.comms.base.geometry.ground import shades_at
from swarmwire.world.sensors.sensor import Scene

WIDTH, HEIGHT = 160, 120  # pixels
AHEAD_M, ABOVE_M = 0.03, 0.028  # position of the camera, from the body's centre and above its lower side
HALF_VIEW_RAD = 0.5 * 0.84
FOCAL_PX = 0.5 * WIDTH / np.tan(HALF_VIEW_RAD)
NEAR_M = 0.005  # nearer objects are invisible
LAMP_RADIUS_M, LAMP_TOP_M = 0.02, 0.1  # a scenario's lights have no size
LED_RADIUS_M = 0.003
BODY_GLOW = 0.6  # brightness of a body that an LED within it lights
SKY, WALL, OBSTACLE, ROBOT, LAMP = (205, 215, 225), (190, 190, 190), (140, 120, 95), (70, 80, 75), (255, 255, 220)
FLOOR_BRIGHTNESS = 0.85  # brightness of a white floor
DIMMEST = 0.5  # brightness of a face at grazing incidence
N = TypeVar("N", float, FloatArray)
_ROWS = np.arange(HEIGHT)[:, None]
# Per m ahead: offset of each column's ray to the left, its length, and offset of each row's ray downwards.
_TO_LEFT: FloatArray = (0.5 * (WIDTH - 1) - np.arange(WIDTH)) / FOCAL_PX
_LENGTH: FloatArray = np.hypot(1.0, _TO_LEFT)
_BELOW: FloatArray = (np.arange(HEIGHT) - 0.5 * (HEIGHT - 1)) / FOCAL_PX


class CameraPose(NamedTuple):
    """The pose of the camera; its frame has x ahead and y to the left."""

    x_m: float
    y_m: float
    height_m: float
    heading_rad: float


class Faces(NamedTuple):
    """Intersections of the columns' rays with a shape."""

    enter_m: FloatArray  # (WIDTH,) depth at which the ray enters the shape; inf: it misses
    leave_m: FloatArray  # (WIDTH,) depth at which the ray leaves the shape
    facing: FloatArray  # (WIDTH,) cosine between the ray and the face at which it enters


def picture(scene: Scene, robot: int) -> bytes:
    """Draw the picture of a robot's camera, by index in the only arena: WIDTH x HEIGHT pixels, row by row."""
    canvas = _Canvas(scene, robot)
    canvas.draw_arena()
    canvas.draw_robots()
    return rgb565(canvas.pixels)


def rgb565(pixels: ByteArray) -> bytes:
    """Encode pixels (rows, columns, 3) of red, green and blue in two bytes each, the high byte first."""
    red, green, blue = np.moveaxis(pixels.astype(np.uint16), -1, 0)
    return ((red & 0xF8) << 8 | (green & 0xFC) << 3 | blue >> 3).astype(">u2").tobytes()


class _Canvas:
    """A picture in progress.

    Attributes:
        pixels: (HEIGHT, WIDTH, 3) red, green, blue.
    """

    def __init__(self, scene: Scene, robot: int) -> None:
        self._scene, self._robot = scene, robot
        x_m, y_m, heading_rad = scene.state[0, robot, :3].tolist()
        self._c, self._s = np.cos(heading_rad), np.sin(heading_rad)
        position_m = x_m + AHEAD_M * self._c, y_m + AHEAD_M * self._s
        self._camera = CameraPose(*position_m, float(scene.bottom_m[robot]) + ABOVE_M, heading_rad)
        self.pixels = np.empty((HEIGHT, WIDTH, 3), np.uint8)
        self._depth_m = np.full((HEIGHT, WIDTH), np.inf)

    def draw_arena(self) -> None:
        """Draw floor, walls, obstacles and lamps."""
        scene, obstacles = self._scene, self._scene.obstacles
        self.pixels[:] = SKY
        self._draw_floor()
        if scene.boundary == "walls":
            self._draw_walls()
        for k in self._in_view(obstacles.circle):
            x, y, radius_m = obstacles.circle[k].tolist()
            self._draw(_disc(*self._in_camera_frame(x, y), radius_m), 0.0, float(obstacles.circle_top_m[k]), OBSTACLE)
        for k in self._in_view(obstacles.polygon):
            x, y, _ = obstacles.polygon[k].tolist()
            sides = obstacles.side[obstacles.side_start[k] : obstacles.side_start[k + 1]]
            ahead, left = self._in_camera_frame(x, y)
            faces = _polygon(self._rotate(sides[:, 2:4]), _side_distances(sides, x, y), ahead, left)
            self._draw(faces, 0.0, float(obstacles.polygon_top_m[k]), OBSTACLE)
        for lamp in scene.lights[0] if scene.lights else ():
            faces = _disc(*self._in_camera_frame(lamp.x_m, lamp.y_m), LAMP_RADIUS_M)
            self._draw(faces._replace(facing=np.ones(WIDTH)), 0.0, LAMP_TOP_M, LAMP)

    def draw_robots(self) -> None:
        """Draw all other robots with their LEDs; an LED within the body lights the body."""
        scene = self._scene
        for robot in self._in_view(np.column_stack([scene.state[0, :, :2], scene.radius_m])):
            if robot == self._robot:
                continue
            x, y, heading_rad = scene.state[0, robot, :3].tolist()
            ahead, left = self._in_camera_frame(x, y)
            radius_m, bottom_m = float(scene.radius_m[robot]), float(scene.bottom_m[robot])
            lit = scene.leds[0, robot].nonzero()[0].tolist()
            positions = {led: scene.led_positions_m[robot, led].tolist() for led in lit}
            colours = {led: _components(int(scene.leds[0, robot, led])) for led in lit}
            inner = [colours[led] for led, position in positions.items() if np.hypot(*position[:2]) < 0.9 * radius_m]
            body = ROBOT
            for colour in inner:
                body = tuple(max(base, int(BODY_GLOW * light)) for base, light in zip(body, colour, strict=True))
            self._draw(_disc(ahead, left, radius_m), bottom_m, float(scene.top_m[robot]), body)
            c, s = np.cos(heading_rad), np.sin(heading_rad)
            for led, (led_x, led_y, led_z) in positions.items():
                offset = self._rotate(np.array([[c * led_x - s * led_y, s * led_x + c * led_y]]))[0]
                self._draw_led(ahead + offset[0], left + offset[1], bottom_m + led_z, colours[led])

    def _draw_floor(self) -> None:
        ground, below = self._scene.ground, _BELOW > 0.0
        depth_m = self._camera.height_m / _BELOW[below]
        left_m = depth_m[:, None] * _TO_LEFT
        ahead_m = np.broadcast_to(depth_m[:, None], left_m.shape)
        x = self._camera.x_m + self._c * ahead_m - self._s * left_m
        y = self._camera.y_m + self._s * ahead_m + self._c * left_m
        shades = shades_at(ground, x.ravel(), y.ravel()).reshape(left_m.shape)
        self.pixels[below] = (255.0 * FLOOR_BRIGHTNESS * shades)[:, :, None].astype(np.uint8)

    def _draw_walls(self) -> None:
        """Draw the inner faces of the arena's walls."""
        width_m, height_m = self._scene.size_m
        normals = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
        distance_m = 0.5 * np.array([width_m, width_m, height_m, height_m]) - normals @ np.array(self._camera[:2])
        speed = self._rotate(normals) @ np.stack([np.ones(WIDTH), _TO_LEFT])
        with np.errstate(divide="ignore"):
            depths_m = np.where(speed > 0.0, np.maximum(distance_m, NEAR_M)[:, None] / speed, np.inf)
        depth_m = depths_m.min(axis=0)
        facing = np.take_along_axis(speed, depths_m.argmin(axis=0)[None], axis=0)[0] / _LENGTH
        self._draw(Faces(depth_m, depth_m, facing), 0.0, np.inf, WALL)

    def _draw(self, faces: Faces, bottom_m: float, top_m: float, colour: tuple[float, ...]) -> None:
        """Draw a shape between two heights above the floor, with its visible upper or lower face."""
        columns = np.flatnonzero(np.isfinite(faces.enter_m))
        if len(columns) == 0:
            return
        enter_m, leave_m = faces.enter_m[columns], faces.leave_m[columns]
        first = np.minimum(self._row(top_m, enter_m), self._row(top_m, leave_m))
        last = np.maximum(self._row(bottom_m, enter_m), self._row(bottom_m, leave_m))
        if bottom_m <= 0.0:
            last = self._row(bottom_m, enter_m)
        shaded = (DIMMEST + (1.0 - DIMMEST) * faces.facing[columns])[:, None] * colour
        covered = (first <= _ROWS) & (last >= _ROWS) & (enter_m < self._depth_m[:, columns])
        row, index = np.nonzero(covered)
        self.pixels[row, columns[index]] = shaded.astype(np.uint8)[index]
        self._depth_m[row, columns[index]] = enter_m[index]

    def _draw_led(self, ahead_m: float, left_m: float, height_m: float, colour: tuple[int, ...]) -> None:
        """Draw an LED in front of the body that carries it, as a disc of at least a pixel."""
        if ahead_m <= NEAR_M:
            return
        column = 0.5 * (WIDTH - 1) - FOCAL_PX * left_m / ahead_m
        row = float(self._row(height_m, np.array(ahead_m)))
        radius_px = max(FOCAL_PX * LED_RADIUS_M / ahead_m, 0.8)
        near = (np.arange(WIDTH) - column) ** 2 + (_ROWS - row) ** 2 <= radius_px * radius_px
        self.pixels[near & (ahead_m - LED_RADIUS_M < self._depth_m)] = colour

    def _row(self, height_m: float, depth_m: FloatArray) -> FloatArray:
        """Return the fractional row of a height above the floor at these depths."""
        return 0.5 * (HEIGHT - 1) + FOCAL_PX * (self._camera.height_m - height_m) / depth_m

    def _in_view(self, circles: FloatArray) -> list[int]:
        """Return the indices of the circles (k, 3) of x, y and radius that reach into the field of view."""
        ahead_m, left_m = self._in_camera_frame(circles[:, 0], circles[:, 1])
        c, s = np.cos(HALF_VIEW_RAD), np.sin(HALF_VIEW_RAD)
        beyond_m = np.maximum(c * np.abs(left_m) - s * ahead_m, NEAR_M - ahead_m)
        return np.flatnonzero(beyond_m < circles[:, 2]).tolist()

    def _in_camera_frame(self, x_m: N, y_m: N) -> tuple[N, N]:
        """Return a point's distances ahead and to the left of the camera; on a torus, for its nearest copy."""
        dx, dy = x_m - self._camera.x_m, y_m - self._camera.y_m
        if self._scene.boundary == "torus":
            width_m, height_m = self._scene.size_m
            dx, dy = dx - width_m * np.rint(dx / width_m), dy - height_m * np.rint(dy / height_m)
        return self._c * dx + self._s * dy, self._c * dy - self._s * dx

    def _rotate(self, vectors: AnyArray) -> FloatArray:
        """Rotate vectors (k, 2) of the arena into the camera's frame."""
        x, y = vectors.T
        return np.stack([self._c * x + self._s * y, self._c * y - self._s * x], axis=1)


def _disc(ahead_m: float, left_m: float, radius_m: float) -> Faces:
    """Intersect the rays with a disc around this point."""
    along = (ahead_m + left_m * _TO_LEFT) / _LENGTH
    offset2 = ahead_m * ahead_m + left_m * left_m - along * along
    root = np.sqrt(np.maximum(radius_m * radius_m - offset2, 0.0))
    is_hit = (offset2 < radius_m * radius_m) & (along + root > NEAR_M)
    enter_m = np.where(is_hit, np.maximum((along - root) / _LENGTH, NEAR_M), np.inf)
    return Faces(enter_m, (along + root) / _LENGTH, root / radius_m)


def _polygon(normals: FloatArray, reach_m: FloatArray, ahead_m: float, left_m: float) -> Faces:
    """Intersect the rays with a convex polygon around this point, by its sides' normals (k, 2) and distances (k,)."""
    outside_m = -(normals @ np.array([ahead_m, left_m])) - reach_m
    speed = normals @ np.stack([np.ones(WIDTH), _TO_LEFT])
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing_m = -outside_m[:, None] / speed
    enters = np.where(speed < 0.0, crossing_m, np.where((speed == 0.0) & (outside_m[:, None] > 0.0), np.inf, -np.inf))
    enter_m, leave_m = enters.max(axis=0), np.where(speed > 0.0, crossing_m, np.inf).min(axis=0)
    is_hit = (enter_m < leave_m) & (leave_m > NEAR_M)
    facing = -np.take_along_axis(speed, enters.argmax(axis=0)[None], axis=0)[0] / _LENGTH
    return Faces(np.where(is_hit, np.maximum(enter_m, NEAR_M), np.inf), leave_m, np.clip(facing, 0.0, 1.0))


def _side_distances(sides: FloatArray, x_m: float, y_m: float) -> FloatArray:
    """Return the distances of a polygon's sides (k, 5) from its centre, (k,)."""
    return sides[:, 4] - sides[:, 2:4] @ np.array([x_m, y_m])


def _components(rgb: int) -> tuple[int, int, int]:
    return rgb >> 16 & 0xFF, rgb >> 8 & 0xFF, rgb & 0xFF
