"""The robots of all arenas, sorted into cells in each tick, so that a sensor looks at near ones only. Compiled."""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.bodies.ranging_specs import FORMS, InfraredSpec, ProximitySpec, RayArraySpec
from swarmwire.comms.geometry.obstacle_index import ObstacleIndex, obstacles_near, obstacles_within, ray_to_obstacle
from swarmwire.comms.geometry.obstacles import ray_to_circle
from swarmwire.comms.geometry.robot_index import Cells, cells_over, column_of, row_of, sort
from swarmwire.comms.kernels import kernel
from swarmwire.comms.truth import Group
from swarmwire.world.sensors.sensor import Field, Noise, Scene

CELLS_PER_ROBOT = 8  # so that few share one where they gather in a corner of a large arena


class RobotIndex(NamedTuple):
    """What kernels know of the robots; `cells` is filled by `cells.sort`."""

    state: FloatArray  # (arenas, robots, 6)
    running: BoolArray  # (arenas,) others are passed over
    radius_m: FloatArray  # (robots,)
    bottom_m: FloatArray  # (robots,)
    top_m: FloatArray  # (robots,)
    wrap_x: float  # extents of a torus in m, 0 if it is none
    wrap_y: float
    per_wrap_x: float  # 1 / wrap_x, or 0
    per_wrap_y: float
    cells: Cells
    found: IntArray  # (robots,) room for those that `near_robots` finds
    found_at: FloatArray  # (robots, 2) and for where they are


def robot_index_of(scene: Scene, reach_m: float) -> RobotIndex:
    """The robots of a scene, for looking at whose centre is within `reach_m`."""
    arenas, robots = scene.state.shape[:2]
    per_cell_m = np.sqrt(scene.size_m[0] * scene.size_m[1] / (CELLS_PER_ROBOT * robots))
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
        cells_over(scene.size_m, max(reach_m, float(per_cell_m)), arenas, arenas * robots),
        np.empty(robots, np.int64),
        np.empty((robots, 2)),
    )


@kernel()
def nearest(at, there, wrap, per_wrap):
    """Where a coordinate `there` is as seen from `at`: on a torus, its image at the least distance."""
    return there - wrap * np.rint((there - at) * per_wrap)


@kernel()
def near_robots(crowd, arena, own, x, y, reach_m, low_m, high_m):
    """Write into `crowd.found` the robots but `own` whose rims are within reach of a place; how many.

    Only those that are somewhere between two heights above the floor.
    """
    cells, count = crowd.cells, 0
    row, column = row_of(cells, y), column_of(cells, x)
    for j in range(min(cells.ny, 3)):
        r = (row + j - 1) % cells.ny
        for i in range(min(cells.nx, 3)):
            c = (arena * cells.ny + r) * cells.nx + (column + i - 1) % cells.nx
            for k in range(cells.start[c], cells.start[c + 1]):
                other = cells.item[k]
                cx = nearest(x, crowd.state[arena, other, 0], crowd.wrap_x, crowd.per_wrap_x)
                cy = nearest(y, crowd.state[arena, other, 1], crowd.wrap_y, crowd.per_wrap_y)
                ox, oy, reach = cx - x, cy - y, reach_m + crowd.radius_m[other]
                if ox * ox + oy * oy >= reach * reach or other == own:
                    continue
                if crowd.bottom_m[other] < high_m and low_m < crowd.top_m[other]:
                    crowd.found[count] = other
                    crowd.found_at[count, 0], crowd.found_at[count, 1] = cx, cy
                    count += 1
    return count


# --- The obstacles of a scene as a sensor looks at them.


class ObstacleIndices:
    """The obstacles of a scene by cell, sorted once, or in each tick where some of them can be pushed."""

    def __init__(self, scene: Scene, reach_m: float, images_m: float | None = None) -> None:
        """For looking `reach_m` far; `images_m` as in `things_within`."""
        self._scene, self._reach_m, self._images_m = scene, reach_m, images_m
        self._things = self._sorted()

    def now(self) -> ObstacleIndex:
        """The obstacles where they stand in this tick; as many as ever."""
        if self._scene.obstacles_move:
            self._things = self._sorted()
        return self._things

    def _sorted(self) -> ObstacleIndex:
        scene = self._scene
        torus = scene.boundary == "torus"
        return obstacles_within(scene.obstacles, scene.size_m, self._reach_m, torus, self._images_m)


# --- A few rays from the rim of each robot, and the nearest thing on each. Compiled; for active and passive infrared.


RATIONAL, QUADRATIC = FORMS.index("rational"), FORMS.index("quadratic")
MARGIN_M = 1e-9  # a disc farther than that from a ray is missed, however numbers are rounded


class RayArray(NamedTuple):
    """The sheet as kernels take it, and room for what they find out of one robot."""

    first: int  # robot of the group
    cos: FloatArray  # (rays,) directions in the body's frame
    sin: FloatArray  # (rays,)
    range_m: float
    half_x: float  # where walls stand; inf: nowhere
    half_y: float
    form: int  # of the response, a place in FORMS; `ResponseCurve` says what the numbers mean
    a: float
    b: float
    c: float
    full_m: float
    reach_m: float
    dx: FloatArray  # (rays,) directions in the arena's frame
    dy: FloatArray  # (rays,)
    hidden_m: FloatArray  # (rays,) how far one sees
    found: IntArray  # (things,)


class RayArraySight:
    """What the rays of a group's robots meet: everything if they are active, else only robots alive and in sight."""

    def __init__(self, scene: Scene, group: Group, spec: RayArraySpec, active: bool) -> None:
        reach_m = group.body.radius_m + spec.range_m
        self._shape = len(scene.keys), group.stop - group.start, len(spec.angle_rad)
        self._active, self._alive, curve = active, scene.alive, spec.response
        self._crowd = robot_index_of(scene, reach_m + float(scene.radius_m.max()))
        self._standing = ObstacleIndices(scene, reach_m)
        walled, (width, height) = scene.boundary == "walls", scene.size_m
        self._fan = RayArray(
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
            np.empty(len(self._standing.now().shape), np.int64),
        )

    def answer(self) -> FloatArray:
        """What an ideal sensor answers to what each ray meets, (arenas, n, rays), 0 to 1."""
        value = np.zeros(self._shape)
        _look(value, self._crowd, self._alive, self._standing.now(), self._fan, self._active, True)
        return value

    def distance_m(self) -> FloatArray:
        """The distance along each ray from the rim, (arenas, n, rays) in m; inf where nothing is within the range."""
        near = np.full(self._shape, np.inf)
        _look(near, self._crowd, self._alive, self._standing.now(), self._fan, self._active, False)
        return near


@kernel(from_python=True)
def _look(value, crowd, alive, things, fan, active, answers):
    """Set value (arenas, n, rays) of robots that have anything near; with `answers` the response to the distance."""
    sort(crowd.cells, crowd.state, crowd.running)
    for arena in range(value.shape[0]):
        if not crowd.running[arena]:
            continue
        for i in range(value.shape[1]):
            own = fan.first + i
            x = nearest(0.0, crowd.state[arena, own, 0], crowd.wrap_x, crowd.per_wrap_x)
            y = nearest(0.0, crowd.state[arena, own, 1], crowd.wrap_y, crowd.per_wrap_y)
            rim = crowd.radius_m[own]
            reach = rim + fan.range_m
            low, high = crowd.bottom_m[own], crowd.top_m[own]
            robots = near_robots(crowd, arena, own, x, y, reach, low, high)
            if not active and robots == 0:
                continue
            count = obstacles_near(fan.found, things, arena, x, y, reach, low)
            at_wall = abs(x) + reach >= fan.half_x or abs(y) + reach >= fan.half_y
            if robots == 0 and count == 0 and not at_wall:
                continue
            _turn(fan, crowd.state[arena, own, 2])
            near = value[arena, i]
            near[:] = np.inf
            if at_wall:
                _meet_walls(near, x, y, rim, fan)
            _meet_things(near, x, y, rim, fan, things, count)
            _meet_robots(near, x, y, rim, fan, crowd, robots, alive[arena], False)
            if not active:
                for ray in range(len(near)):
                    fan.hidden_m[ray], near[ray] = near[ray], np.inf
            _meet_robots(near, x, y, rim, fan, crowd, robots, alive[arena], True)
            for ray in range(len(near)):
                d = near[ray]
                if d > fan.range_m or (not active and d > fan.hidden_m[ray]):
                    d = np.inf
                near[ray] = _answer(d, fan) if answers else d


@kernel()
def _turn(fan, heading):
    """Set the directions of the rays of a robot."""
    c, s = np.cos(heading), np.sin(heading)
    for ray in range(len(fan.dx)):
        fan.dx[ray] = c * fan.cos[ray] - s * fan.sin[ray]
        fan.dy[ray] = s * fan.cos[ray] + c * fan.sin[ray]


@kernel()
def _meet_walls(near, x, y, rim, fan):
    for ray in range(len(near)):
        for at, step, end in ((x, fan.dx[ray], fan.half_x), (y, fan.dy[ray], fan.half_y)):
            if step != 0.0:
                wall = end if step > 0.0 else -end
                near[ray] = min(near[ray], max((wall - at - rim * step) / step, 0.0))


@kernel()
def _meet_things(near, x, y, rim, fan, things, count):
    for at in range(count):
        for ray in range(len(near)):
            dx, dy = fan.dx[ray], fan.dy[ray]
            near[ray] = min(near[ray], ray_to_obstacle(x + rim * dx, y + rim * dy, dx, dy, things, fan.found[at]))


@kernel()
def _meet_robots(near, x, y, rim, fan, crowd, count, alive, living):
    """Those of the robots found that are alive, or those that are dead."""
    for at in range(count):
        if alive[crowd.found[at]] != living:
            continue
        cx, cy, radius = crowd.found_at[at, 0], crowd.found_at[at, 1], crowd.radius_m[crowd.found[at]]
        ox, oy = cx - x, cy - y
        for ray in range(len(near)):
            dx, dy = fan.dx[ray], fan.dy[ray]
            if abs(ox * dy - oy * dx) <= radius + MARGIN_M:
                near[ray] = min(near[ray], ray_to_circle(x + rim * dx, y + rim * dy, dx, dy, cx, cy, radius))


@kernel()
def _answer(distance, fan):
    """What a sensor answers to a distance (`ResponseCurve.value`)."""
    if distance > fan.reach_m:
        return 0.0
    if fan.form == QUADRATIC:
        value = fan.a * distance * distance + fan.b * distance + fan.c
    elif distance < fan.full_m:
        value = 1.0
    elif fan.form == RATIONAL:
        value = fan.a / (distance + fan.b)
    else:
        value = fan.a / ((distance + fan.b) * (distance + fan.b))
    return min(max(value, 0.0), 1.0)


# --- Proximity: rays from the rim that end at the nearest robot, obstacle or wall, seen through the sensor's response.


class ProximitySensor:
    """Sense `proximity`: value (n, rays), the sensors' answers, 0 to 1. Noise is uniform, and new in every reading."""

    def __init__(self, scene: Scene, group: Group, spec: ProximitySpec) -> None:
        self._sight = RayArraySight(scene, group, spec, active=True)
        noise = Noise("uniform", spec.noise)
        self.fields = (Field("value", len(spec.angle_rad), noise, spec.step, low=0.0, high=1.0, blank=0.0),)

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """What every ray of every robot of the group would answer without noise."""
        return (self._sight.answer(),)

    def distance_m(self) -> FloatArray:
        """The true distance along each ray, (arenas, n, rays) in m; inf where nothing is within the range."""
        return self._sight.distance_m()


# --- Passive infrared: rays from the rim that end at the nearest robot alive, unless something stands before it.


class InfraredSensor:
    """Sense `infrared`: value (n, rays), the answers to other robots' light, 0 to 1. Noise is uniform."""

    def __init__(self, scene: Scene, group: Group, spec: InfraredSpec) -> None:
        self._sight = RayArraySight(scene, group, spec, active=False)
        noise = Noise("uniform", spec.noise)
        self.fields = (Field("value", len(spec.angle_rad), noise, spec.step, low=0.0, high=1.0, blank=0.0),)

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """What every ray of every robot of the group would answer without noise."""
        return (self._sight.answer(),)
