"""Sensors that cast a few rays from the rim of the body: proximity (active) and infrared (passive). Compiled.

`RobotIndex` and the obstacle index find robots and obstacles near a point; the scan, light and camera sensors use them,
too. `RayArraySight` finds the nearest hit on each ray of a group's robots and applies the response of the sensor.
"""

# pyright: basic, reportUnknownMemberType=false

from functools import partial
from typing import NamedTuple

import numpy as np

from swarmwire.comms.base import math as portable
from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.base.geometry.obstacle_index import ObstacleIndices, obstacles_near, ray_to_obstacle
from swarmwire.comms.base.geometry.obstacles import ray_to_circle
from swarmwire.comms.base.geometry.robot_index import Grid, column_of, grid_over, row_of, sort
from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.base.math import compiled as math_compiled
from swarmwire.comms.observe.truth import Group
from swarmwire.comms.robot.sensors.rays import FORMS, InfraredSpec, ProximitySpec, RayArraySpec
from swarmwire.world.sensors.sensor import BuiltInSensor, Scene

CELLS_PER_ROBOT = 8  # a number at which few robots share a cell if they gather in a corner of a large arena
RATIONAL, QUADRATIC = FORMS.index("rational"), FORMS.index("quadratic")
MARGIN_M = 1e-9  # a disc farther than that from a ray is missed, despite rounding


class RobotIndex(NamedTuple):
    """The robots of all arenas by cell, for kernels; `robot_index.sort` fills `cells` in each tick."""

    state: FloatArray  # (arenas, robots, 6)
    running: BoolArray  # (arenas,) arenas to index
    radius_m: FloatArray  # (robots,)
    bottom_m: FloatArray  # (robots,)
    top_m: FloatArray  # (robots,)
    wrap_x: float  # extents of a torus in m, 0 in other arenas
    wrap_y: float
    per_wrap_x: float  # 1 / wrap_x, or 0
    per_wrap_y: float
    cells: Grid
    nearby: IntArray  # (robots,) buffer of `near_robots`: robot indices
    nearby_xy: FloatArray  # (robots, 2) buffer: their positions


def robot_index_of(scene: Scene, reach_m: float) -> RobotIndex:
    """Return the index of a scene's robots, for queries of centres within `reach_m`."""
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
    """Return the image of a coordinate on a torus that is nearest to `origin`; in other arenas the coordinate."""
    return coordinate - wrap * np.rint((coordinate - origin) * per_wrap)


@kernel()
def near_robots(robots, arena, excluded, x, y, reach_m, low_m, high_m):
    """Write the robots whose rims are within reach of a point to `robots.nearby`, and return their number.

    Only robots that extend between the two heights above the floor count, except robot `excluded`.
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
                if ox * ox + oy * oy >= reach * reach or other == excluded:
                    continue
                if robots.bottom_m[other] < high_m and low_m < robots.top_m[other]:
                    robots.nearby[count] = other
                    robots.nearby_xy[count, 0], robots.nearby_xy[count, 1] = cx, cy
                    count += 1
    return count


def obstacle_indices_of(scene: Scene, reach_m: float, images_m: float | None = None) -> ObstacleIndices:
    """Return the obstacle index of a scene, for queries within `reach_m`; see `obstacles_within` for `images_m`."""
    torus = scene.boundary == "torus"
    return ObstacleIndices(scene.obstacles, scene.size_m, reach_m, torus, images_m, scene.obstacles_move)


class RayArray(NamedTuple):
    """The spec of a ray array for kernels, and buffers for one robot."""

    first: int  # robot index of the group's first robot
    cos: FloatArray  # (rays,) directions in the body's frame
    sin: FloatArray  # (rays,)
    range_m: float
    half_x: float  # distance of the walls from the centre, in m; inf: no walls
    half_y: float
    active: bool  # False: rays end at robots that are alive, and other bodies block them
    form: int  # index of the response's form in FORMS; `ResponseCurve` defines the numbers below
    a: float
    b: float
    c: float
    full_m: float
    reach_m: float
    dx: FloatArray  # (rays,) directions in the arena's frame
    dy: FloatArray  # (rays,)
    visible_m: FloatArray  # (rays,) distance to the first opaque body
    nearby: IntArray  # (obstacles,) buffer


class Share(NamedTuple):
    """The robots of a group that one call of the kernel computes, in every arena."""

    first: int  # index in the group
    stop: int
    sorts: bool  # True: the call fills the index of robots before


class RayArraySight:
    """The nearest hit of each ray: on any body for an active sensor, else on robots that are alive and in sight."""

    def __init__(self, scene: Scene, group: Group, spec: RayArraySpec, active: bool) -> None:
        reach_m = group.body.radius_m + spec.range_m
        self._shape = len(scene.keys), group.stop - group.start, len(spec.angle_rad)
        self._alive, curve = scene.alive, spec.response
        self._threads = scene.threads
        self._robots = robot_index_of(scene, reach_m + float(scene.radius_m.max()))
        self._obstacles = obstacle_indices_of(scene, reach_m)
        walled, (width, height) = scene.boundary == "walls", scene.size_m
        self._rays = RayArray(
            group.start,
            portable.cos(spec.angle_rad),
            portable.sin(spec.angle_rad),
            spec.range_m,
            0.5 * width if walled else np.inf,
            0.5 * height if walled else np.inf,
            active,
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
        # The same with other buffers, for another thread.
        self._other_robots = self._robots._replace(
            nearby=np.empty_like(self._robots.nearby), nearby_xy=np.empty_like(self._robots.nearby_xy)
        )
        self._other_rays = self._rays._replace(
            dx=np.empty_like(self._rays.dx),
            dy=np.empty_like(self._rays.dy),
            visible_m=np.empty_like(self._rays.visible_m),
            nearby=np.empty_like(self._rays.nearby),
        )

    def response(self) -> FloatArray:
        """Return the noise-free response of each ray, (arenas, n, rays), 0 to 1."""
        return self._cast(np.zeros(self._shape), responses=True)

    def distance_m(self) -> FloatArray:
        """Return the distance along each ray from the rim, (arenas, n, rays) in m; inf: nothing within the range."""
        return self._cast(np.full(self._shape, np.inf), responses=False)

    def _cast(self, value: FloatArray, *, responses: bool) -> FloatArray:
        """Set `value` by `_cast_rays`, half of the robots in another thread if that pays, and return it."""
        arenas, count, _ = self._shape
        robots, obstacles, rows = self._robots, self._obstacles.now(), arenas * count
        if not self._threads.are_worth(rows):
            _cast_rays(value, robots, self._alive, obstacles, self._rays, responses, Share(0, count, True))
            return value
        sort(robots.cells, robots.state, robots.running)
        half = count // 2
        other_half = self._other_robots, self._alive, obstacles, self._other_rays, responses, Share(half, count, False)
        join = self._threads.start(partial(_cast_rays, value, *other_half), rows)
        _cast_rays(value, robots, self._alive, obstacles, self._rays, responses, Share(0, half, False))
        join()
        return value


@kernel(from_python=True, nogil=True)
def _cast_rays(value, robots, alive, obstacles, rays, responses, share):
    """Set value (arenas, n, rays) of a share's robots with anything near: responses if `responses`, else distances."""
    if share.sorts:
        sort(robots.cells, robots.state, robots.running)
    for arena in range(value.shape[0]):
        if not robots.running[arena]:
            continue
        for i in range(share.first, share.stop):
            robot = rays.first + i
            x = nearest(0.0, robots.state[arena, robot, 0], robots.wrap_x, robots.per_wrap_x)
            y = nearest(0.0, robots.state[arena, robot, 1], robots.wrap_y, robots.per_wrap_y)
            radius = robots.radius_m[robot]
            reach = radius + rays.range_m
            low, high = robots.bottom_m[robot], robots.top_m[robot]
            robot_count = near_robots(robots, arena, robot, x, y, reach, low, high)
            if not rays.active and robot_count == 0:
                continue
            count = obstacles_near(rays.nearby, obstacles, arena, x, y, reach, low)
            at_wall = abs(x) + reach >= rays.half_x or abs(y) + reach >= rays.half_y
            if robot_count == 0 and count == 0 and not at_wall:
                continue
            _turn(rays, robots.state[arena, robot, 2])
            near = value[arena, i]
            near[:] = np.inf
            disc = x, y, radius
            if at_wall:
                _hit_walls(near, disc, rays)
            _hit_obstacles(near, disc, rays, obstacles, count)
            _hit_robots(near, disc, rays, robots, robot_count, alive[arena], False)
            if not rays.active:
                for ray in range(len(near)):
                    rays.visible_m[ray], near[ray] = near[ray], np.inf
            _hit_robots(near, disc, rays, robots, robot_count, alive[arena], True)
            for ray in range(len(near)):
                d = near[ray]
                if d > rays.range_m or (not rays.active and d > rays.visible_m[ray]):
                    d = np.inf
                near[ray] = _response(d, rays) if responses else d


@kernel()
def _turn(rays, heading):
    """Rotate the ray directions of a robot into the arena's frame."""
    c, s = math_compiled.cos(heading), math_compiled.sin(heading)
    for ray in range(len(rays.dx)):
        rays.dx[ray] = c * rays.cos[ray] - s * rays.sin[ray]
        rays.dy[ray] = s * rays.cos[ray] + c * rays.sin[ray]


@kernel()
def _hit_walls(near, disc, rays):
    x, y, radius = disc
    for ray in range(len(near)):
        for centre, step, half in ((x, rays.dx[ray], rays.half_x), (y, rays.dy[ray], rays.half_y)):
            if step != 0.0:
                wall = half if step > 0.0 else -half
                near[ray] = min(near[ray], max((wall - centre - radius * step) / step, 0.0))


@kernel()
def _hit_obstacles(near, disc, rays, obstacles, count):
    x, y, radius = disc
    for k in rays.nearby[:count]:
        for ray in range(len(near)):
            dx, dy = rays.dx[ray], rays.dy[ray]
            near[ray] = min(near[ray], ray_to_obstacle(x + radius * dx, y + radius * dy, dx, dy, obstacles, k))


@kernel()
def _hit_robots(near, disc, rays, robots, count, alive, is_alive):
    """Intersect the rays from the rim of a disc with the nearby robots that are alive, or with those that are dead."""
    x, y, radius = disc
    for k in range(count):
        other = robots.nearby[k]
        if alive[other] != is_alive:
            continue
        cx, cy, other_radius = robots.nearby_xy[k, 0], robots.nearby_xy[k, 1], robots.radius_m[other]
        ox, oy = cx - x, cy - y
        for ray in range(len(near)):
            dx, dy = rays.dx[ray], rays.dy[ray]
            if abs(ox * dy - oy * dx) <= other_radius + MARGIN_M:
                near[ray] = min(
                    near[ray], ray_to_circle(x + radius * dx, y + radius * dy, dx, dy, cx, cy, other_radius)
                )


@kernel()
def _response(distance, rays):
    """Return the response to a distance (`ResponseCurve.value`)."""
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
        """Index the bodies that rays may hit."""
        self._sight = RayArraySight(self.scene, self.group, self.spec, active=True)

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """Return the noise-free response of every ray of every robot of the group."""
        return (self._sight.response(),)

    def distance_m(self) -> FloatArray:
        """Return the true distance along each ray, (arenas, n, rays) in m; inf: nothing within the range."""
        return self._sight.distance_m()


class InfraredSensor(BuiltInSensor[InfraredSpec]):
    """Sensor `infrared`: value (n, rays), 0 to 1, the response to the infrared light of other robots.

    Rays start at the rim and end at the nearest robot that is alive, unless something blocks them. Noise is uniform.
    """

    def start(self) -> None:
        """Index the bodies that rays may hit."""
        self._sight = RayArraySight(self.scene, self.group, self.spec, active=False)

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """Return the noise-free response of every ray of every robot of the group."""
        return (self._sight.response(),)
