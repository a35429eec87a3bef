"""Whether anything stands in a straight line over the floor, looked for in the cells along it. Compiled."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.bodies.ranging_specs import LightSpec
from swarmwire.comms.geometry.obstacle_index import ray_to_obstacle
from swarmwire.comms.geometry.obstacles import ray_to_circle
from swarmwire.comms.geometry.robot_index import sort
from swarmwire.comms.kernels import kernel
from swarmwire.comms.truth import Group
from swarmwire.world.sensors.rays import ObstacleIndices, nearest, robot_index_of
from swarmwire.world.sensors.sensor import Field, Noise, Scene

MARGIN_M = 1e-9  # a line along the border of two cells goes through both


@kernel()
def things_between(things, arena, x, y, to_x, to_y, low_m):
    """Whether an obstacle higher than `low_m` touches the line from x, y to another place."""
    cells = things.cells
    apart = np.sqrt((to_x - x) ** 2 + (to_y - y) ** 2)
    if apart == 0.0 or len(things.shape) == 0:
        return False
    dx, dy = (to_x - x) / apart, (to_y - y) / apart
    for column in range(_cell(min(x, to_x), cells.per_x, cells.nx), _cell(max(x, to_x), cells.per_x, cells.nx) + 1):
        low, high = _rows(cells, column, MARGIN_M, x, y, to_x, to_y)
        for row in range(low, high + 1):
            c = (arena * cells.ny + row % cells.ny) * cells.nx + column % cells.nx
            for at in range(cells.start[c], cells.start[c + 1]):
                k = cells.item[at]
                if things.shape[k, 3] > low_m and ray_to_obstacle(x, y, dx, dy, things, k) <= apart:
                    return True
    return False


@kernel()
def robots_between(crowd, widest_m, arena, own, x, y, to_x, to_y):
    """Whether a robot that is as high as robot `own` somewhere touches the line from its place x, y to another."""
    cells = crowd.cells
    apart = np.sqrt((to_x - x) ** 2 + (to_y - y) ** 2)
    if apart == 0.0:
        return False
    dx, dy = (to_x - x) / apart, (to_y - y) / apart
    middle_x, middle_y = 0.5 * (x + to_x), 0.5 * (y + to_y)
    first = _cell(min(x, to_x) - widest_m, cells.per_x, cells.nx)
    last = _cell(max(x, to_x) + widest_m, cells.per_x, cells.nx)
    for column in range(first, last + 1):
        low, high = _rows(cells, column, widest_m, x, y, to_x, to_y)
        for row in range(low, high + 1):
            c = (arena * cells.ny + row % cells.ny) * cells.nx + column % cells.nx
            for at in range(cells.start[c], cells.start[c + 1]):
                other = cells.item[at]
                beside = crowd.bottom_m[other] < crowd.top_m[own] and crowd.bottom_m[own] < crowd.top_m[other]
                if other == own or not beside:
                    continue
                cx = nearest(middle_x, crowd.state[arena, other, 0], crowd.wrap_x, crowd.per_wrap_x)
                cy = nearest(middle_y, crowd.state[arena, other, 1], crowd.wrap_y, crowd.per_wrap_y)
                if ray_to_circle(x, y, dx, dy, cx, cy, crowd.radius_m[other]) <= apart:
                    return True
    return False


@kernel()
def _cell(at, per, cells):
    """The column or row of a coordinate, not rolled up."""
    return int(np.floor(at * per + 0.5 * cells))


@kernel()
def _rows(cells, column, margin_m, x, y, to_x, to_y):
    """First and last row of a column, not rolled up, where something this wide may touch the line."""
    low, high = min(y, to_y), max(y, to_y)
    if to_x != x:
        left = (column - 0.5 * cells.nx) / cells.per_x - margin_m
        right = (column + 1.0 - 0.5 * cells.nx) / cells.per_x + margin_m
        slope = (to_y - y) / (to_x - x)
        one = y + slope * (max(left, min(x, to_x)) - x)
        other = y + slope * (min(right, max(x, to_x)) - x)
        low, high = max(low, min(one, other)), min(high, max(one, other))
    return _cell(low - margin_m, cells.per_y, cells.ny), _cell(high + margin_m, cells.per_y, cells.ny)


# --- Light: photocells around the body that answer to every light in sight, as ARGoS's rot_z_only sensor does.
#
# A cell that is turned by dphi from a light at distance d of intensity I (m) answers
#
#     exp(-2 d / I) * (1 - 2 |dphi| / pi)    for d <= 2.5 I and |dphi| < pi / 2, else 0;
#
# answers of several lights add up, then uniform noise, then clipping to [0, 1]. (ARGoS 3, foot-bot and e-puck
# `light_rotzonly_sensor`.) A light is hidden if the straight line to it from the centre of the body meets an obstacle
# or another robot that is at the same height.


REACH = 2.5  # a light is dark beyond that many of its intensities
TURN_RAD = 2.0 * np.pi


class LightSensor:
    """Sense `light`: value (n, sensors), 0 dark to 1. Noise is uniform, and new in every reading."""

    def __init__(self, scene: Scene, group: Group, spec: LightSpec) -> None:
        self._scene, self._group, self._spec = scene, group, spec
        noise = Noise("uniform", spec.noise)
        self.fields = (Field("value", len(spec.angle_rad), noise, spec.step, low=0.0, high=1.0, blank=0.0),)
        lights = [(a, light) for a, some in enumerate(scene.lights) for light in some]
        self._arena = np.array([a for a, _ in lights], np.int64)
        self._light = np.array([(of.x_m, of.y_m, of.intensity_m) for _, of in lights], np.float64).reshape(-1, 3)
        self._widest_m = float(scene.radius_m.max())
        self._crowd = robot_index_of(scene, 2.0 * self._widest_m)
        self._standing = ObstacleIndices(scene, 0.0, images_m=0.5 * max(scene.size_m))  # no light is farther on a torus

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """What every photocell of every robot of the group answers, without noise; more than 1 where lights add up."""
        scene, group, angle = self._scene, self._group, self._spec.angle_rad
        value = np.zeros((len(scene.keys), group.stop - group.start, len(angle)))
        around = self._crowd, self._widest_m, self._standing.now()
        _shine(value, group.start, angle, *around, self._arena, self._light)
        return (value,)


@kernel(from_python=True)
def _shine(value, start, angle, crowd, widest_m, things, arena_of, lights):
    """Add what the cells of each robot (arenas, n, sensors) see of each light."""
    sort(crowd.cells, crowd.state, crowd.running)
    for k in range(len(lights)):
        arena, intensity = arena_of[k], lights[k, 2]
        if not crowd.running[arena]:
            continue
        for i in range(value.shape[1]):
            own = start + i
            x = nearest(0.0, crowd.state[arena, own, 0], crowd.wrap_x, crowd.per_wrap_x)
            y = nearest(0.0, crowd.state[arena, own, 1], crowd.wrap_y, crowd.per_wrap_y)
            to_x = nearest(x, lights[k, 0], crowd.wrap_x, crowd.per_wrap_x)
            to_y = nearest(y, lights[k, 1], crowd.wrap_y, crowd.per_wrap_y)
            dx, dy = to_x - x, to_y - y
            distance = np.sqrt(dx * dx + dy * dy)
            if distance > REACH * intensity:
                continue
            if things_between(things, arena, x, y, to_x, to_y, crowd.bottom_m[own]):
                continue
            if robots_between(crowd, widest_m, arena, own, x, y, to_x, to_y):
                continue
            glow, bearing = np.exp(-2.0 * distance / intensity), np.arctan2(dy, dx) - crowd.state[arena, own, 2]
            for cell in range(len(angle)):
                off = abs(bearing - angle[cell]) % TURN_RAD
                off = min(off, TURN_RAD - off)
                value[arena, i, cell] += glow * max(1.0 - 2.0 * off / np.pi, 0.0)
