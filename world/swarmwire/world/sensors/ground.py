"""Ground colour: the shade of the floor at points of the body's frame. Compiled."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.bodies.sensors import GroundColour
from swarmwire.comms.geometry.ground import shade_at
from swarmwire.comms.kernels import borrowing
from swarmwire.comms.truth import Group
from swarmwire.world.sensors.scene import Scene
from swarmwire.world.sensors.sensor import Field, Noise


class GroundSensor:
    """Sense `ground`: shade (n, points), 0 black to 1 white, of the floor under each point. Noise is uniform."""

    def __init__(self, scene: Scene, group: Group, sheet: GroundColour) -> None:
        self._scene, self._group = scene, group
        self._points = np.array(sheet.points_m, np.float64)
        noise = Noise("uniform", sheet.noise)
        self.fields = (Field("shade", len(self._points), noise, sheet.step, low=0.0, high=1.0),)

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """The shade under every point of every robot of the group."""
        scene, group = self._scene, self._group
        shade = np.empty((len(scene.keys), group.stop - group.start, len(self._points)))
        _look_down(shade, scene.state, scene.running, group.start, self._points, scene.ground)
        return (shade,)


@borrowing(from_python=True)
def _look_down(shade, state, running, start, points, ground):
    """Set shade (arenas, n, points)."""
    for arena in range(shade.shape[0]):
        if not running[arena]:
            continue
        for i in range(shade.shape[1]):
            x, y, heading = state[arena, start + i, 0], state[arena, start + i, 1], state[arena, start + i, 2]
            c, s = np.cos(heading), np.sin(heading)
            for k in range(len(points)):
                ahead, left = points[k, 0], points[k, 1]
                shade[arena, i, k] = shade_at(ground, x + c * ahead - s * left, y + s * ahead + c * left)
