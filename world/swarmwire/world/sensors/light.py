"""The light sensor, and the line of sight over the floor that it needs. Compiled.

`robot_between` tests a straight line against the robots in the cells along it.
"""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.geometry.line_of_sight import cell_at, cell_number, obstacle_between, rows_along
from swarmwire.comms.base.geometry.obstacles import ray_to_circle
from swarmwire.comms.base.geometry.robot_index import sort
from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.robot.sensors.light import LightSpec
from swarmwire.world.sensors.rays import nearest, obstacle_indices_of, robot_index_of
from swarmwire.world.sensors.sensor import BuiltInSensor

RANGE_INTENSITIES = 2.5  # the range of a light, in multiples of its intensity
TURN_RAD = 2.0 * np.pi


@kernel()
def robot_between(robots, widest_m, arena, own, x, y, to_x, to_y):
    """Whether a robot whose height overlaps that of robot `own` touches the line from its place x, y to another."""
    cells = robots.cells
    distance_m = np.sqrt((to_x - x) ** 2 + (to_y - y) ** 2)
    if distance_m == 0.0:
        return False
    dx, dy = (to_x - x) / distance_m, (to_y - y) / distance_m
    middle_x, middle_y = 0.5 * (x + to_x), 0.5 * (y + to_y)
    first = cell_at(min(x, to_x) - widest_m, cells.per_x, cells.nx)
    last = cell_at(max(x, to_x) + widest_m, cells.per_x, cells.nx)
    for column in range(first, last + 1):
        low, high = rows_along(cells, column, widest_m, x, y, to_x, to_y)
        for row in range(low, high + 1):
            c = cell_number(cells, arena, column, row)
            for at in range(cells.start[c], cells.start[c + 1]):
                other = cells.item[at]
                beside = robots.bottom_m[other] < robots.top_m[own] and robots.bottom_m[own] < robots.top_m[other]
                if other == own or not beside:
                    continue
                cx = nearest(middle_x, robots.state[arena, other, 0], robots.wrap_x, robots.per_wrap_x)
                cy = nearest(middle_y, robots.state[arena, other, 1], robots.wrap_y, robots.per_wrap_y)
                if ray_to_circle(x, y, dx, dy, cx, cy, robots.radius_m[other]) <= distance_m:
                    return True
    return False


class LightSensor(BuiltInSensor[LightSpec]):
    """Sensor `light`: value (n, sensors), 0 dark to 1, photocells around the body. Noise is uniform, new each reading.

    A cell at the angle dphi from a light at distance d of intensity I (m) responds with

        exp(-2 d / I) * (1 - 2 |dphi| / pi)    for d <= 2.5 I and |dphi| < pi / 2, else 0.

    Responses to several lights add up, then uniform noise, then clipping to [0, 1] (ARGoS 3, foot-bot and e-puck
    `light_rotzonly_sensor`). A light is hidden if the straight line to it from the centre of the body meets an obstacle
    or another robot at the same height.
    """

    def start(self) -> None:
        """List the lights, and index what may hide them."""
        scene = self.scene
        lights = [(a, light) for a, arena_lights in enumerate(scene.lights) for light in arena_lights]
        self._arena = np.array([a for a, _ in lights], np.int64)
        self._light = np.array([(light.x_m, light.y_m, light.intensity_m) for _, light in lights], np.float64).reshape(
            -1, 3
        )
        self._widest_m = float(scene.radius_m.max())
        self._robots = robot_index_of(scene, 2.0 * self._widest_m)
        self._obstacles = obstacle_indices_of(
            scene, 0.0, images_m=0.5 * max(scene.size_m)
        )  # no light is farther on a torus

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """The noise-free response of every photocell of the group; it may exceed 1 where lights add up."""
        scene, group, angle = self.scene, self.group, self.spec.angle_rad
        value = np.zeros((len(scene.keys), group.stop - group.start, len(angle)))
        geometry = self._robots, self._widest_m, self._obstacles.now()
        _shine(value, group.start, angle, *geometry, self._arena, self._light)
        return (value,)


@kernel(from_python=True)
def _shine(value, start, angle, robots, widest_m, obstacles, arena_of, lights):
    """Add the response of each robot's cells to each light to value (arenas, n, sensors)."""
    sort(robots.cells, robots.state, robots.running)
    for k in range(len(lights)):
        arena, intensity = arena_of[k], lights[k, 2]
        if not robots.running[arena]:
            continue
        for i in range(value.shape[1]):
            own = start + i
            x = nearest(0.0, robots.state[arena, own, 0], robots.wrap_x, robots.per_wrap_x)
            y = nearest(0.0, robots.state[arena, own, 1], robots.wrap_y, robots.per_wrap_y)
            to_x = nearest(x, lights[k, 0], robots.wrap_x, robots.per_wrap_x)
            to_y = nearest(y, lights[k, 1], robots.wrap_y, robots.per_wrap_y)
            dx, dy = to_x - x, to_y - y
            distance = np.sqrt(dx * dx + dy * dy)
            if distance > RANGE_INTENSITIES * intensity:
                continue
            if obstacle_between(obstacles, arena, x, y, to_x, to_y, robots.bottom_m[own]):
                continue
            if robot_between(robots, widest_m, arena, own, x, y, to_x, to_y):
                continue
            glow, bearing = np.exp(-2.0 * distance / intensity), np.arctan2(dy, dx) - robots.state[arena, own, 2]
            for cell in range(len(angle)):
                off = abs(bearing - angle[cell]) % TURN_RAD
                off = min(off, TURN_RAD - off)
                value[arena, i, cell] += glow * max(1.0 - 2.0 * off / np.pi, 0.0)
