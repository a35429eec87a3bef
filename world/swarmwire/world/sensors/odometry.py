"""Wheel encoders: travel since the start, with slip and in whole steps."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np
from numba import njit

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.draws import purpose
from swarmwire.comms.draws_compiled import normal
from swarmwire.comms.sheets import Odometry
from swarmwire.comms.truth import Group
from swarmwire.world.sensors.scene import Scene
from swarmwire.world.sensors.sensor import Field

SLIP = purpose("odometry slip")


class OdometrySensor:
    """Sense `odometry`: left_m, right_m (n,), travel since the start, rounded down to whole encoder steps.

    Slip is a property of each tick's travel, so it is part of what is counted, not of a reading.
    """

    fields = (Field("left_m"), Field("right_m"))

    def __init__(self, scene: Scene, group: Group, sheet: Odometry) -> None:
        self._scene, self._group, self._sheet = scene, group, sheet
        self._rolled_m = self._true()
        self._told_m = self._rolled_m.copy()

    def _true(self) -> FloatArray:
        return self._scene.travel_m[:, self._group.start : self._group.stop].copy()

    def follow(self, tick: int) -> None:
        """Add the travel since the last tick, with a slip of its own: how often an agent looks changes nothing."""
        rolled_m = self._true()
        new_m, keys = rolled_m - self._rolled_m, self._scene.keys
        _add_travel(self._told_m, new_m, keys, self._group.start, tick, self._sheet.slip)
        self._rolled_m = rolled_m

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """The travel that the encoders of every robot show."""
        self.follow(tick)
        step_m = self._sheet.step_m
        shown = np.floor(self._told_m / step_m) * step_m if step_m > 0.0 else self._told_m
        return shown[:, :, 0].copy(), shown[:, :, 1].copy()


@njit(cache=True)
def _add_travel(told, new, keys, start, tick, slip):
    """Add the new travel of both wheels to what was told: times 1 + slip x a normal draw for each wheel."""
    for arena in range(told.shape[0]):
        for i in range(told.shape[1]):
            for wheel in range(2):
                factor = 1.0 + slip * normal(keys[arena], start + i, tick, wheel, SLIP) if slip > 0.0 else 1.0
                told[arena, i, wheel] += new[arena, i, wheel] * factor
