"""Wheel encoders: travel since the start, with errors that add up, in whole steps."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np
from numba import njit

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.bodies.sensors import Odometry
from swarmwire.comms.draws import normal as normals
from swarmwire.comms.draws import purpose
from swarmwire.comms.draws_compiled import normal
from swarmwire.comms.truth import Group
from swarmwire.world.sensors.scene import Scene
from swarmwire.world.sensors.sensor import Field

SLIP, WHEEL = purpose("odometry slip"), purpose("odometry wheel")


class OdometrySensor:
    """Sense `odometry`: left_m, right_m (n,), travel since the start, rounded down to whole encoder steps.

    Errors belong to the travel, each tick's slip and each wheel's size, so they are part of what is counted, not of a
    reading.
    """

    def __init__(self, scene: Scene, group: Group, sheet: Odometry) -> None:
        self._scene, self._group, self._sheet = scene, group, sheet
        self.fields = (Field("left_m", step=sheet.step), Field("right_m", step=sheet.step))
        self._rolled_m = scene.travel_m[:, group.start : group.stop].copy()
        self._told_m = self._rolled_m.copy()
        robots = np.arange(group.start, group.stop)
        drawn = normals(scene.keys[:, None, None], robots[:, None], 0, np.arange(2), WHEEL)
        self._scale = 1.0 + sheet.wheel_error_std * drawn  # (arenas, n, wheels)

    def follow(self, tick: int) -> None:
        """Add the travel since the last tick, with a slip of its own: how often an agent looks changes nothing."""
        scene, start = self._scene, self._group.start
        of, arenas = (self._told_m, self._rolled_m, scene.travel_m), (scene.keys, scene.running)
        _add_travel(*of, start, self._scale, *arenas, tick, self._sheet.slip)

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """The travel that the encoders of every robot show."""
        self.follow(tick)
        step_m = self._sheet.step_m
        shown = np.floor(self._told_m / step_m) * step_m if step_m > 0.0 else self._told_m
        return shown[:, :, 0].copy(), shown[:, :, 1].copy()


@njit(cache=True)
def _add_travel(told, rolled, travel, start, scale, keys, running, tick, slip):
    """Add the new travel of both wheels to what was told: times the wheel's scale, times 1 + slip x a normal draw."""
    for arena in range(told.shape[0]):
        if not running[arena]:
            continue
        for i in range(told.shape[1]):
            for wheel in range(2):
                now = travel[arena, start + i, wheel]
                new = (now - rolled[arena, i, wheel]) * scale[arena, i, wheel]
                if slip > 0.0:
                    new *= 1.0 + slip * normal(keys[arena], start + i, tick, wheel, SLIP)
                told[arena, i, wheel] += new
                rolled[arena, i, wheel] = now
