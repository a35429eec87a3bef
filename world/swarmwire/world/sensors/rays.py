"""Sensors that cast a few rays from the rim of the body: proximity (active) and infrared (passive). Compiled.

`RobotIndex` and the obstacle index find robots and obstacles near a place; the scan, light and camera sensors use them,
too. `RayArraySight` finds the nearest thing on each ray of a group's robots and applies the response of the sensor.
"""

# pyright: basic, reportUnknownMemberType=false

from functools import partial
from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.base.geometry.obstacle_index import ObstacleIndices, obstacles_near, ray_to_obstacle
from swarmwire.comms.base.geometry.obstacles import ray_to_circle
from swarmwire.comms.base.geometry.robot_index import Grid, column_of, grid_over, row_of, sort
from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.observe.truth import Group
from swarmwire.comms.robot.sensors.rays import FORMS, InfraredSpec, ProximitySpec, RayArraySpec
from swarmwire.world.sensors.sensor import BuiltInSensor, Scene

CELLS_PER_ROBOT = 8  # so that few robots share a cell where they gather in a corner of a large arena
RATIONAL, QUADRATIC = FORMS.index("rational"), FORMS.index("quadratic")
MARGIN_M = 1e-9  # a disc farther than that from a ray is missed, despite rounding


class RobotIndex(NamedTuple):
    """The robots of all arenas by cell, for kernels; `robot_index.sort` fills `cells` in each tick."""

    state: FloatArray  # (arenas, robots, 6)
    running: BoolArray  # (arenas,) others are skipped
    radius_m: FloatArray  # (robots,)
    bottom_m: FloatArray  # (robots,)
    top_m: FloatArray  # (robots,)
    wrap_x: float  # extents of a torus in m, 0 if it is none
    wrap_y: float
    per_wrap_x: float  # 1 / wrap_x, or 0
    per_wrap_y: float
    cells: Grid
    nearby: IntArray  # (robots,) buffer: robots that `near_robots` found
    nearby_at: FloatArray  # (robots, 2) buffer: their positions


def robot_index_of(scene: Scene, reach_m: float) -> RobotIndex:
    """The index of a scene's robots, for queries of centres within `reach_m`."""
    arenas, robot_count = scene.state.shape[:2]
    per_cell_m = np.sqrt(scene.size_m[0] * scene.size_m[1] / (CELLS_PER_ROBOT * robot_count))
    torus = scene.boundary == "torus"
    wrap_x, wrap_y = scene.size_m if torus else (0.0, 0.0)
    per_wrap_x, per_wrap_y = (1.0 / wrap_x, 1.0 / wrap_y) if torus else (0.0, 0.0)
    return RobotIndex(
        scene.state,
        scene.running,
        scene.radius_m,
        scene.bottom_m,
        scene.top_m,
        wrap_x,
        wrap_y,
        per_wrap_x,
        per_wrap_y,
        grid_over(scene.size_m, max(reach_m, float(per_cell_m)), arenas, arenas * robot_count),
        np.empty(robot_count, np.int64),
        np.empty((robot_count, 2)),
    )


@kernel()
def nearest(origin, coordinate, wrap, per_wrap):
    """The image of a coordinate that is nearest to `origin`; off a torus the coordinate itself."""
    return coordinate - wrap * np.rint((coordinate - origin) * per_wrap)


@kernel()
def near_robots(robots, arena, own, x, y, reach_m, low_m, high_m):
    """Write the robots, except `own`, whose rims are within reach of a place to `robots.nearby`; returns their number.

    Only robots that extend between the two heights above the floor count.
    """
    cells, count = robots.cells, 0
    row, column = row_of(cells, y), column_of(cells, x)
    for j in range(min(cells.ny, 3)):
        r = (row + j - 1) % cells.ny
        for i in range(min(cells.nx, 3)):
            c = (arena * cells.ny + r) * cells.nx + (column + i - 1) % cells.nx
            for k in range(cells.start[c], cells.start[c + 1]):
                other = cells.item[k]
                cx = nearest(x, robots.state[arena, other, 0], robots.wrap_x, robots.per_wrap_x)
                cy = nearest(y, robots.state[arena, other, 1], robots.wrap_y, robots.per_wrap_y)
                ox, oy, reach = cx - x, cy - y, reach_m + robots.radius_m[other]
                if ox * ox + oy * oy >= reach * reach or other == own:
                    continue
                if robots.bottom_m[other] < high_m and low_m < robots.top_m[other]:
                    robots.nearby[count] = other
                    robots.nearby_at[count, 0], robots.nearby_at[count, 1] = cx, cy
                    count += 1
    return count


def obstacle_indices_of(scene: Scene, reach_m: float, images_m: float | None = None) -> ObstacleIndices:
    """The obstacle index of a scene, for queries within `reach_m`; `images_m` as in `obstacles_within`."""
    torus = scene.boundary == "torus"
    return ObstacleIndices(scene.obstacles, scene.size_m, reach_m, torus, images_m, scene.obstacles_move)


class RayArray(NamedTuple):
    """The spec of a ray array for kernels, and buffers for one robot."""

    first: int  # robot index of the group's first robot
    cos: FloatArray  # (rays,) directions in the body's frame
    sin: FloatArray  # (rays,)
    range_m: float
    half_x: float  # of the walls, in m; inf: no walls
    half_y: float
    form: int  # of the response, an index into FORMS; `ResponseCurve` defines the numbers
    a: float
    b: float
    c: float
    full_m: float
    reach_m: float
    dx: FloatArray  # (rays,) directions in the arena's frame
    dy: FloatArray  # (rays,)
    visible_m: FloatArray  # (rays,) distance to the first opaque thing
    nearby: IntArray  # (obstacles,) buffer


class RayArraySight:
    """The nearest hit of each ray: of anything for an active sensor, else of robots that are alive and in sight."""

    def __init__(self, scene: Scene, group: Group, spec: RayArraySpec, active: bool) -> None:
        reach_m = group.body.radius_m + spec.range_m
        self._shape = len(scene.keys), group.stop - group.start, len(spec.angle_rad)
        self._active, self._alive, curve = active, scene.alive, spec.response
        self._threads = scene.threads
        self._robots = robot_index_of(scene, reach_m + float(scene.radius_m.max()))
        self._obstacles = obstacle_indices_of(scene, reach_m)
        walled, (width, height) = scene.boundary == "walls", scene.size_m
        self._rays = RayArray(
            group.start,
            np.cos(spec.angle_rad),
            np.sin(spec.angle_rad),
            spec.range_m,
            0.5 * width if walled else np.inf,
            0.5 * height if walled else np.inf,
            FORMS.index(curve.kind),
            curve.a,
            curve.b,
            curve.c,
            curve.full_m,
            curve.reach_m,
            np.empty(self._shape[2]),
            np.empty(self._shape[2]),
            np.empty(self._shape[2]),
            np.empty(len(self._obstacles.now().shape), np.int64),
        )
        # The same with buffers of their own, for another thread.
        self._other_robots = self._robots._replace(
            nearby=np.empty_like(self._robots.nearby), nearby_at=np.empty_like(self._robots.nearby_at)
        )
        self._other_rays = self._rays._replace(
            dx=np.empty_like(self._rays.dx),
            dy=np.empty_like(self._rays.dy),
            visible_m=np.empty_like(self._rays.visible_m),
            nearby=np.empty_like(self._rays.nearby),
        )

    def answer(self) -> FloatArray:
        """The noise-free response of each ray, (arenas, n, rays), 0 to 1."""
        return self._looked(np.zeros(self._shape), answers=True)

    def distance_m(self) -> FloatArray:
        """The distance along each ray from the rim, (arenas, n, rays) in m; inf where nothing is within the range."""
        return self._looked(np.full(self._shape, np.inf), answers=False)

    def _looked(self, value: FloatArray, *, answers: bool) -> FloatArray:
        """`value`, set by `_look`; each half of the robots in a thread of its own, where that is worth it."""
        arenas, count, _ = self._shape
        robots, obstacles, rows = self._robots, self._obstacles.now(), arenas * count
        what = self._active, answers
        if not self._threads.are_worth(rows):
            _look(value, robots, self._alive, obstacles, self._rays, *what, 0, count, True)
            return value
        sort(robots.cells, robots.state, robots.running)
        half = count // 2
        others = value, self._other_robots, self._alive, obstacles, self._other_rays, *what, half, count, False
        rest = self._threads.start(partial(_look, *others), rows)
        _look(value, robots, self._alive, obstacles, self._rays, *what, 0, half, False)
        rest()
        return value


@kernel(from_python=True, nogil=True)
def _look(value, robots, alive, obstacles, rays, active, answers, first, stop, sorts):
    """Set value (arenas, n, rays) of robots with anything near: distances, or with `answers` the responses.

    Of each arena only the robots `first` to `stop` - 1 of the group look. With `sorts` the index is filled before.
    """
    if sorts:
        sort(robots.cells, robots.state, robots.running)
    for arena in range(value.shape[0]):
        if not robots.running[arena]:
            continue
        for i in range(first, stop):
            own = rays.first + i
            x = nearest(0.0, robots.state[arena, own, 0], robots.wrap_x, robots.per_wrap_x)
            y = nearest(0.0, robots.state[arena, own, 1], robots.wrap_y, robots.per_wrap_y)
            radius = robots.radius_m[own]
            reach = radius + rays.range_m
            low, high = robots.bottom_m[own], robots.top_m[own]
            robot_count = near_robots(robots, arena, own, x, y, reach, low, high)
            if not active and robot_count == 0:
                continue
            count = obstacles_near(rays.nearby, obstacles, arena, x, y, reach, low)
            at_wall = abs(x) + reach >= rays.half_x or abs(y) + reach >= rays.half_y
            if robot_count == 0 and count == 0 and not at_wall:
                continue
            _turn(rays, robots.state[arena, own, 2])
            near = value[arena, i]
            near[:] = np.inf
            if at_wall:
                _meet_walls(near, x, y, radius, rays)
            _meet_obstacles(near, x, y, radius, rays, obstacles, count)
            _meet_robots(near, x, y, radius, rays, robots, robot_count, alive[arena], False)
            if not active:
                for ray in range(len(near)):
                    rays.visible_m[ray], near[ray] = near[ray], np.inf
            _meet_robots(near, x, y, radius, rays, robots, robot_count, alive[arena], True)
            for ray in range(len(near)):
                d = near[ray]
                if d > rays.range_m or (not active and d > rays.visible_m[ray]):
                    d = np.inf
                near[ray] = _answer(d, rays) if answers else d


@kernel()
def _turn(rays, heading):
    """Rotate the ray directions of a robot into the arena's frame."""
    c, s = np.cos(heading), np.sin(heading)
    for ray in range(len(rays.dx)):
        rays.dx[ray] = c * rays.cos[ray] - s * rays.sin[ray]
        rays.dy[ray] = s * rays.cos[ray] + c * rays.sin[ray]


@kernel()
def _meet_walls(near, x, y, radius, rays):
    for ray in range(len(near)):
        for at, step, end in ((x, rays.dx[ray], rays.half_x), (y, rays.dy[ray], rays.half_y)):
            if step != 0.0:
                wall = end if step > 0.0 else -end
                near[ray] = min(near[ray], max((wall - at - radius * step) / step, 0.0))


@kernel()
def _meet_obstacles(near, x, y, radius, rays, obstacles, count):
    for at in range(count):
        for ray in range(len(near)):
            dx, dy = rays.dx[ray], rays.dy[ray]
            near[ray] = min(
                near[ray], ray_to_obstacle(x + radius * dx, y + radius * dy, dx, dy, obstacles, rays.nearby[at])
            )


@kernel()
def _meet_robots(near, x, y, radius, rays, robots, count, alive, is_alive):
    """Intersect the rays with the nearby robots that are alive, or with those that are dead."""
    for at in range(count):
        if alive[robots.nearby[at]] != is_alive:
            continue
        cx, cy, other_radius = robots.nearby_at[at, 0], robots.nearby_at[at, 1], robots.radius_m[robots.nearby[at]]
        ox, oy = cx - x, cy - y
        for ray in range(len(near)):
            dx, dy = rays.dx[ray], rays.dy[ray]
            if abs(ox * dy - oy * dx) <= other_radius + MARGIN_M:
                near[ray] = min(
                    near[ray], ray_to_circle(x + radius * dx, y + radius * dy, dx, dy, cx, cy, other_radius)
                )


@kernel()
def _answer(distance, rays):
    """The response to a distance (`ResponseCurve.value`)."""
    if distance > rays.reach_m:
        return 0.0
    if rays.form == QUADRATIC:
        value = rays.a * distance * distance + rays.b * distance + rays.c
    elif distance < rays.full_m:
        value = 1.0
    elif rays.form == RATIONAL:
        value = rays.a / (distance + rays.b)
    else:
        value = rays.a / ((distance + rays.b) * (distance + rays.b))
    return min(max(value, 0.0), 1.0)


class ProximitySensor(BuiltInSensor[ProximitySpec]):
    """Sensor `proximity`: value (n, rays), 0 to 1, the response to the nearest robot, obstacle or wall on each ray.

    Rays start at the rim. Noise is uniform, and new in every reading.
    """

    def start(self) -> None:
        """Index what the rays may meet."""
        self._sight = RayArraySight(self.scene, self.group, self.spec, active=True)

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """The noise-free response of every ray of every robot of the group."""
        return (self._sight.answer(),)

    def distance_m(self) -> FloatArray:
        """The true distance along each ray, (arenas, n, rays) in m; inf where nothing is within the range."""
        return self._sight.distance_m()


class InfraredSensor(BuiltInSensor[InfraredSpec]):
    """Sensor `infrared`: value (n, rays), 0 to 1, the response to the infrared light of other robots.

    Rays start at the rim and end at the nearest robot that is alive, unless something blocks them. Noise is uniform.
    """

    def start(self) -> None:
        """Index what the rays may meet."""
        self._sight = RayArraySight(self.scene, self.group, self.spec, active=False)

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """The noise-free response of every ray of every robot of the group."""
        return (self._sight.answer(),)
