"""Batteries: the energy that robots draw in a tick. Compiled."""

# pyright: basic, reportUnknownMemberType=false

from collections.abc import Sequence
from math import inf

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.observe.truth import Group
from swarmwire.comms.robot.sensors.simple import BatterySpec
from swarmwire.world.actuation.actuators import HOLONOMIC, drive_limits_of, wheels_of_twist

PER_HOUR = 3600.0
EMPTY = 1e-9  # of a full charge: less is nothing, so rounding adds no tick
MAINS = BatterySpec(capacity_wh=inf)  # of a body without a battery: its charge never falls


class Batteries:
    """The batteries of all robots of all arenas; `any`: whether there are some.

    Attributes:
        charge: (arenas, robots) 1 full, 0 empty; always 1 for a body without a battery. Changed in place, and may be.
    """

    def __init__(self, groups: Sequence[Group], arenas: int, tick_s: float) -> None:
        """Charged as their data sheets say."""
        sizes = [group.stop - group.start for group in groups]
        specs = [group.body.battery or MAINS for group in groups]
        self.any = any(spec is not MAINS for spec in specs)
        self.charge: FloatArray = np.tile(np.repeat([spec.start for spec in specs], sizes), (arenas, 1))
        draw = [(spec.idle_w + spec.hover_w, spec.drive_w_per_mps, spec.led_w, spec.idle_w) for spec in specs]
        share = tick_s / PER_HOUR / np.array([spec.capacity_wh for spec in specs])  # of a charge, per W and tick
        self._draw = np.repeat(np.array(draw) * share[:, None], sizes, axis=0)  # (robots, 4) in a tick
        limits = drive_limits_of(groups)
        self._wheel_base_m, self._holonomic = limits.wheel_base_m, limits.kind == HOLONOMIC

    @property
    def empty(self) -> BoolArray:
        """Robots without charge, (rows,)."""
        return self.charge.ravel() <= 0.0

    def renew(self, rows: BoolArray) -> None:
        """Those of these robots (rows,) that are empty get a full battery."""
        self.charge[(rows & self.empty).reshape(self.charge.shape)] = 1.0

    def drain(self, alive: BoolArray, leds: IntArray, target: FloatArray, motors_off: BoolArray) -> None:
        """Draw what a tick takes.

        Args:
            alive: (rows,) the others are switched off, and draw nothing.
            leds: (arenas, robots, LEDs) 0 dark.
            target: (arenas, robots, 3) what engines are given.
            motors_off: (arenas, robots) those that stand on the floor without `hover_w`.
        """
        _drain(self.charge, self._draw, self._wheel_base_m, self._holonomic, alive, leds, target, motors_off)


@njit()
def _drain(charge, draw, wheel_base_m, holonomic, alive, leds, target, motors_off):
    robots = charge.shape[1]
    for arena in range(charge.shape[0]):
        for i in range(robots):
            if not alive[arena * robots + i]:
                continue
            forward, turn, lateral = target[arena, i]
            if holonomic[i]:
                speed = np.hypot(forward, lateral)
            else:
                left, right = wheels_of_twist(forward, turn, wheel_base_m[i])
                speed = 0.5 * (abs(left) + abs(right))
            lit = 0
            for led in leds[arena, i]:
                lit += led != 0
            always = draw[i, 3] if motors_off[arena, i] else draw[i, 0]
            left_over = charge[arena, i] - (always + draw[i, 1] * speed + draw[i, 2] * lit)
            charge[arena, i] = left_over if left_over > EMPTY else 0.0
