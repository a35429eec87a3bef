"""Light: photocells around the body that answer to every light in sight, as ARGoS's rot_z_only sensor does.

A cell that is turned by dphi from a light at distance d of intensity I (m) answers

    exp(-2 d / I) * (1 - 2 |dphi| / pi)    for d <= 2.5 I and |dphi| < pi / 2, else 0;

answers of several lights add up, then uniform noise, then clipping to [0, 1]. (ARGoS 3, foot-bot and e-puck
`light_rotzonly_sensor`.) A light is hidden if the straight line to it from the centre of the body meets an obstacle or
another robot. Robots are looked for in the cells of a grid along that line.
"""

# pyright: basic, reportUnknownMemberType=false

import numpy as np
from numba import njit

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.geometry import is_blocked, ray_to_circle
from swarmwire.comms.grid import build, cell_of
from swarmwire.comms.sheets import Light
from swarmwire.comms.truth import Group
from swarmwire.world.sensors.scene import Scene
from swarmwire.world.sensors.sensor import Field, Noise

REACH = 2.5  # a light is dark beyond that many of its intensities
TURN_RAD = 2.0 * np.pi


class LightSensor:
    """Sense `light`: value (n, sensors), 0 dark to 1. Noise is uniform, and new in every reading."""

    def __init__(self, scene: Scene, group: Group, sheet: Light) -> None:
        self._scene, self._group, self._sheet = scene, group, sheet
        noise = Noise("uniform", sheet.noise)
        self.fields = (Field("value", len(sheet.angle_rad), noise, sheet.step, low=0.0, high=1.0, blank=0.0),)
        lights = [(a, light) for a, some in enumerate(scene.lights) for light in some]
        self._arena = np.array([a for a, _ in lights], np.int64)
        self._light = np.array([(of.x_m, of.y_m, of.intensity_m) for _, of in lights], np.float64).reshape(-1, 3)
        width, height = scene.size_m
        per_robot_m = np.sqrt(width * height / len(scene.radius_m))  # about a robot in each cell
        self._cell_m = max(2.0 * float(scene.radius_m.max()), float(per_robot_m))

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """What every photocell of every robot of the group answers, without noise; more than 1 where lights add up."""
        scene, group, sheet = self._scene, self._group, self._sheet
        x, y = scene.state[:, :, 0].ravel(), scene.state[:, :, 1].ravel()
        grid = build(x, y, len(scene.keys), scene.size_m, self._cell_m)
        value = np.zeros((len(scene.keys), group.stop - group.start, len(sheet.angle_rad)))
        angle = sheet.angle_rad
        _shine(value, scene.state, group.start, scene.radius_m, angle, grid, scene.obstacles, self._arena, self._light)
        return (value,)


@njit(cache=True)
def _shine(value, state, start, radius, angle, grid, obstacles, arena_of, lights):
    """Add what the cells of each robot (arenas, n, sensors) see of each light."""
    widest = radius.max()
    for k in range(len(lights)):
        arena, (lx, ly, intensity) = arena_of[k], lights[k]
        for i in range(value.shape[1]):
            x, y, heading = state[arena, start + i, :3]
            dx, dy = lx - x, ly - y
            distance = np.sqrt(dx * dx + dy * dy)
            if distance > REACH * intensity or is_blocked(obstacles, arena, x, y, lx, ly):
                continue
            if _is_shaded(state[arena], radius, widest, grid, arena, start + i, lx, ly, distance):
                continue
            glow, bearing = np.exp(-2.0 * distance / intensity), np.arctan2(dy, dx) - heading
            for cell in range(len(angle)):
                off = abs(bearing - angle[cell]) % TURN_RAD
                off = min(off, TURN_RAD - off)
                value[arena, i, cell] += glow * max(1.0 - 2.0 * off / np.pi, 0.0)


@njit(cache=True)
def _is_shaded(state, radius, widest, grid, arena, own, lx, ly, distance):
    """Whether another robot of the arena meets the line from robot `own` to a light; its cells, column by column."""
    if distance == 0.0:
        return False
    x, y = state[own, 0], state[own, 1]
    dx, dy = (lx - x) / distance, (ly - y) / distance
    first = cell_of(min(x, lx) - widest, grid.left_m, grid.cell_m, grid.nx)
    last = cell_of(max(x, lx) + widest, grid.left_m, grid.cell_m, grid.nx)
    for column in range(first, last + 1):
        low, high = _rows(grid, column, widest, x, y, lx, ly)
        for row in range(low, high + 1):
            cell = (arena * grid.ny + row) * grid.nx + column
            for k in range(grid.start[cell], grid.start[cell + 1]):
                other = grid.order[k] - arena * len(radius)
                if other != own:
                    cx, cy = state[other, 0], state[other, 1]
                    if ray_to_circle(x, y, dx, dy, cx, cy, radius[other]) <= distance:
                        return True
    return False


@njit(cache=True)
def _rows(grid, column, widest, x, y, lx, ly):
    """First and last row of a column that may hold a robot which meets the line from x, y to lx, ly.

    The first and the last column hold what is outside the arena as well.
    """
    low, high = min(y, ly), max(y, ly)
    if lx != x:
        left = grid.left_m + column * grid.cell_m - widest if column > 0 else -np.inf
        right = grid.left_m + (column + 1) * grid.cell_m + widest if column < grid.nx - 1 else np.inf
        slope = (ly - y) / (lx - x)
        ends = (y + slope * (max(left, min(x, lx)) - x), y + slope * (min(right, max(x, lx)) - x))
        low, high = max(low, min(ends)), min(high, max(ends))
    low, high = low - widest, high + widest
    return (
        cell_of(low, grid.bottom_m, grid.cell_m, grid.ny),
        cell_of(high, grid.bottom_m, grid.cell_m, grid.ny),
    )
