"""Batteries: the energy that robots draw in a tick. Compiled."""

from collections.abc import Sequence
from math import inf
from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.base.math import compiled as math_compiled
from swarmwire.comms.observe.truth import Group
from swarmwire.comms.robot.sensors.simple import BatterySpec
from swarmwire.world.actuation.actuators import HOLONOMIC, drive_limits_of, wheels_of_twist

PER_HOUR = 3600.0
EMPTY = 1e-9  # share of a full charge: less counts as empty, so that rounding adds no tick
MAINS = BatterySpec(capacity_wh=inf)  # spec of a body without a battery: its charge never falls


class PowerDraw(NamedTuple):
    """The power that each robot index draws."""

    per_tick: FloatArray  # (robots, 4) in charges: always, per m/s, per lit LED, always with the motors off
    wheel_base_m: FloatArray  # (robots,)
    holonomic: BoolArray  # (robots,)


class Batteries:
    """The batteries of all robots of all arenas.

    Attributes:
        any: True if any body has a battery.
        charge: (arenas, robots) 1 full, 0 empty; always 1 for a body without a battery. Written in place, also by
            custom actuators.
    """

    def __init__(self, groups: Sequence[Group], arenas: int, tick_s: float) -> None:
        """Make batteries with the initial charge of their data sheets."""
        sizes = [group.stop - group.start for group in groups]
        specs = [group.body.battery or MAINS for group in groups]
        self.any = any(spec is not MAINS for spec in specs)
        self.charge: FloatArray = np.tile(np.repeat([spec.start for spec in specs], sizes), (arenas, 1))
        draw = [(spec.idle_w + spec.hover_w, spec.drive_w_per_mps, spec.led_w, spec.idle_w) for spec in specs]
        charge_per_w = tick_s / PER_HOUR / np.array([spec.capacity_wh for spec in specs])
        limits = drive_limits_of(groups)
        self._draw = PowerDraw(
            np.repeat(np.array(draw) * charge_per_w[:, None], sizes, axis=0),
            limits.wheel_base_m,
            limits.kind == HOLONOMIC,
        )

    @property
    def empty(self) -> BoolArray:
        """Robots without charge, (rows,)."""
        return self.charge.ravel() <= 0.0

    def renew(self, rows: BoolArray) -> None:
        """Replace the empty batteries of these robots (rows,) by full batteries."""
        self.charge[(rows & self.empty).reshape(self.charge.shape)] = 1.0

    def drain(self, alive: BoolArray, leds: IntArray, target: FloatArray, motors_off: BoolArray) -> None:
        """Draw the power of one tick.

        Args:
            alive: (rows,) dead robots are switched off, and draw nothing.
            leds: (arenas, robots, LEDs) 0 dark.
            target: (arenas, robots, 3) targets of the engines.
            motors_off: (arenas, robots) flying bodies on the floor, which draw no `hover_w`.
        """
        _drain(self.charge, self._draw, alive, leds, target, motors_off)


@njit()
def _drain(charge: AnyArray, draw: Any, alive: AnyArray, leds: AnyArray, target: AnyArray, motors_off: AnyArray):
    robots = charge.shape[1]
    for arena in range(charge.shape[0]):
        for i in range(robots):
            if not alive[arena * robots + i]:
                continue
            forward, turn, lateral = target[arena, i]
            if draw.holonomic[i]:
                speed = math_compiled.hypot(forward, lateral)
            else:
                left, right = wheels_of_twist(forward, turn, draw.wheel_base_m[i])
                speed = 0.5 * (abs(left) + abs(right))
            lit = 0
            for led in leds[arena, i]:
                lit += led != 0
            per_tick = draw.per_tick[i]
            always = per_tick[3] if motors_off[arena, i] else per_tick[0]
            new_charge = charge[arena, i] - (always + per_tick[1] * speed + per_tick[2] * lit)
            charge[arena, i] = new_charge if new_charge > EMPTY else 0.0
