"""Light: photocells around the body that answer to every light in sight, as ARGoS's rot_z_only sensor does.

A cell that is turned by dphi from a light at distance d of intensity I (m) answers

    exp(-2 d / I) * (1 - 2 |dphi| / pi)    for d <= 2.5 I and |dphi| < pi / 2, else 0;

answers of several lights add up, then uniform noise, then clipping to [0, 1]. (ARGoS 3, foot-bot and e-puck
`light_rotzonly_sensor`.) A light is hidden if the straight line to it from the centre of the body meets an obstacle or
another robot that is at the same height.
"""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.bodies.sensors import Light
from swarmwire.comms.geometry.robot_index import sort
from swarmwire.comms.kernels import borrowing
from swarmwire.comms.truth import Group
from swarmwire.world.sensors.crowd import crowd_of, nearest
from swarmwire.world.sensors.in_sight import robots_between, things_between
from swarmwire.world.sensors.scene import Scene
from swarmwire.world.sensors.sensor import Field, Noise
from swarmwire.world.sensors.standing import Standing

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
        self._widest_m = float(scene.radius_m.max())
        self._crowd = crowd_of(scene, 2.0 * self._widest_m)
        self._standing = Standing(scene, 0.0, images_m=0.5 * max(scene.size_m))  # no light is farther on a torus

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """What every photocell of every robot of the group answers, without noise; more than 1 where lights add up."""
        scene, group, angle = self._scene, self._group, self._sheet.angle_rad
        value = np.zeros((len(scene.keys), group.stop - group.start, len(angle)))
        around = self._crowd, self._widest_m, self._standing.now()
        _shine(value, group.start, angle, *around, self._arena, self._light)
        return (value,)


@borrowing(from_python=True)
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
