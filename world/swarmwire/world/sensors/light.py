"""The light sensor, and its line of sight over the floor. Compiled.

`robot_between` tests a straight line against the robots in the cells along it.
"""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.geometry.line_of_sight import cell_at, cell_number, obstacle_between, rows_along
from swarmwire.comms.base.geometry.obstacles import ray_to_circle
from swarmwire.comms.base.geometry.robot_index import sort
from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.base.math import compiled as math_compiled
from swarmwire.comms.robot.sensors.light import LightSpec
from swarmwire.world.sensors.rays import nearest, obstacle_indices_of, robot_index_of
from swarmwire.world.sensors.sensor import BuiltInSensor

RANGE_INTENSITIES = 2.5  # the range of a light, in multiples of its intensity
TURN_RAD = 2.0 * np.pi


@kernel()
def robot_between(robots, widest_m, arena, robot, x, y, to_x, to_y):
    """Return True if another robot at the height of `robot` touches the line from its position x, y to another."""
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
            for other in cells.item[cells.start[c] : cells.start[c + 1]]:
                above = robots.bottom_m[other] >= robots.top_m[robot]
                below = robots.bottom_m[robot] >= robots.top_m[other]
                if other == robot or above or below:
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
        """List the lights, and index the bodies that may hide them."""
        scene = self.scene
        lights = [(a, light) for a, arena_lights in enumerate(scene.lights) for light in arena_lights]
        self._light_arena = np.array([a for a, _ in lights], np.int64)
        light_rows = [(light.x_m, light.y_m, light.intensity_m) for _, light in lights]
        self._lights = np.array(light_rows, np.float64).reshape(-1, 3)
        self._widest_m = float(scene.radius_m.max())
        self._robots = robot_index_of(scene, 2.0 * self._widest_m)
        max_distance_m = 0.5 * max(scene.size_m)  # the greatest distance of a light on a torus, along an axis
        self._obstacles = obstacle_indices_of(scene, 0.0, images_m=max_distance_m)

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """Return the noise-free response of every photocell of the group; it may exceed 1 where lights add up."""
        scene, group, angle = self.scene, self.group, self.spec.angle_rad
        value = np.zeros((len(scene.keys), group.stop - group.start, len(angle)))
        lights = self._light_arena, self._lights
        _add_lights(value, group.start, angle, self._robots, self._widest_m, self._obstacles.now(), lights)
        return (value,)


@kernel(from_python=True)
def _add_lights(value, start, angle, robots, widest_m, obstacles, lights):
    """Add the response of each robot's cells to each light to value (arenas, n, sensors).

    `lights` are the arena of each light (k,), and its x, y and intensity (k, 3).
    """
    sort(robots.cells, robots.state, robots.running)
    light_arena, light = lights
    for k in range(len(light)):
        arena, intensity = light_arena[k], light[k, 2]
        if not robots.running[arena]:
            continue
        for i in range(value.shape[1]):
            robot = start + i
            x = nearest(0.0, robots.state[arena, robot, 0], robots.wrap_x, robots.per_wrap_x)
            y = nearest(0.0, robots.state[arena, robot, 1], robots.wrap_y, robots.per_wrap_y)
            to_x = nearest(x, light[k, 0], robots.wrap_x, robots.per_wrap_x)
            to_y = nearest(y, light[k, 1], robots.wrap_y, robots.per_wrap_y)
            dx, dy = to_x - x, to_y - y
            distance = np.sqrt(dx * dx + dy * dy)
            if distance > RANGE_INTENSITIES * intensity:
                continue
            bottom_m = robots.bottom_m[robot]
            if obstacle_between(obstacles, arena, x, y, bottom_m, to_x, to_y, bottom_m):
                continue
            if robot_between(robots, widest_m, arena, robot, x, y, to_x, to_y):
                continue
            brightness = math_compiled.exp(-2.0 * distance / intensity)
            bearing = math_compiled.atan2(dy, dx) - robots.state[arena, robot, 2]
            for cell in range(len(angle)):
                deviation = abs(bearing - angle[cell]) % TURN_RAD
                deviation = min(deviation, TURN_RAD - deviation)
                value[arena, i, cell] += brightness * max(1.0 - 2.0 * deviation / np.pi, 0.0)
