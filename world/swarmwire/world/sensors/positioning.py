"""Positioning: where a robot is in the arena's frame, with a normal error that is new in every tick."""

# pyright: basic, reportUnknownMemberType=false

from numba import njit

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.draws import purpose
from swarmwire.comms.draws_compiled import normal
from swarmwire.comms.sheets import Positioning
from swarmwire.comms.truth import Group
from swarmwire.world.sensors.scene import Scene

NOISE = purpose("positioning noise")


class PositioningSensor:
    """Sense `positioning`: x_m, y_m (n,), in m, arena frame."""

    def __init__(self, scene: Scene, group: Group, sheet: Positioning) -> None:
        self._scene, self._group, self._sheet = scene, group, sheet

    def read(self, tick: int) -> dict[str, FloatArray]:
        """The position that every robot of the group is told in a tick."""
        position = self._scene.state[:, self._group.start : self._group.stop, :2].copy()
        if self._sheet.noise_m > 0.0:
            _add_noise(position, self._scene.keys, self._group.start, tick, self._sheet.noise_m)
        x, y = (position[:, :, axis].flatten() for axis in (0, 1))
        return {"positioning.x_m": x, "positioning.y_m": y}


@njit(cache=True)
def _add_noise(position, keys, start, tick, deviation):
    for arena in range(position.shape[0]):
        for i in range(position.shape[1]):
            for axis in range(2):
                position[arena, i, axis] += deviation * normal(keys[arena], start + i, tick, axis, NOISE)
