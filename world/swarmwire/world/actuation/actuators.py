"""The actuators of all robots: drives with their limits, noise and failures, and LEDs. Compiled.

A command passes two kernels in each tick: `take_commands` limits it to the drive; `drive_target` turns it into the
target of the engines, by way of the speeds of wheels where these are noisy or have failed.
"""

# pyright: basic, reportUnknownMemberType=false

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from swarmwire.comms.base import draws
from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray, KeyArray
from swarmwire.comms.base.draws_compiled import normal
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.observe.truth import Group
from swarmwire.comms.robot.bodies import drives
from swarmwire.comms.robot.bodies.body import MOTORS, WHEELS
from swarmwire.comms.robot.bodies.drives import DRIVES, NO_WHEEL_NOISE, Drive, Holonomic, WheelNoise, wheel_base_of
from swarmwire.comms.robot.tick_io import Actions, SparseTable

DIFFERENTIAL, TWIST, HOLONOMIC = (list(DRIVES).index(kind) for kind in ("wheels", "twist", "holonomic"))
ROUNDING_FACTOR = 1.0 + 1e-9  # a command at exactly the limit is not clipped, despite rounding
BIAS, FACTOR = draws.purpose("wheel bias"), draws.purpose("wheel factor")
LEFT, RIGHT = range(2)
wheels_of_twist, twist_of_wheels = njit()(drives.wheels_of_twist), njit()(drives.twist_of_wheels)


class DriveLimits(NamedTuple):
    """The speed limits of each robot index of an arena, (robots,) each."""

    kind: IntArray  # DIFFERENTIAL, TWIST or HOLONOMIC
    wheel_base_m: FloatArray  # 0: it has no wheels
    max_linear_mps: FloatArray  # of wheels that of a wheel, of a holonomic drive that of the planar vector
    max_angular_radps: FloatArray


def drive_limits_of(groups: Sequence[Group]) -> DriveLimits:
    """The limits of the groups' drives."""
    columns = [
        (list(DRIVES).index(drive.kind), wheel_base_of(drive), drive.max_linear_mps, drive.max_angular_radps)
        for drive in (group.body.drive for group in groups)
    ]
    sizes = [group.stop - group.start for group in groups]
    kind, *rest = (np.repeat(np.array(column), sizes) for column in zip(*columns, strict=True))
    return DriveLimits(kind, *rest)


@njit()
def take_commands(
    limits: DriveLimits,
    alive: BoolArray,
    rows: IntArray,
    drive: BoolArray,
    linear_mps: FloatArray,
    angular_radps: FloatArray,
    lateral_mps: FloatArray,
    command: FloatArray,
) -> tuple[IntArray, IntArray]:
    """Limit new commands to the drives and write them into `command` (rows, 3), which holds the last ones.

    A differential drive scales both speeds by one factor, so that the curve stays the same. A twist drive cuts each
    speed to its own limit. A holonomic drive scales the planar vector, so that the direction stays, and cuts the turn.
    Bodies with wheels do not move sideways.

    Args:
        limits: of each robot index.
        alive: (all rows,).
        rows: (n,) robot row of each command.
        drive: (n,) False: no command.
        linear_mps: (n,) forward speed.
        angular_radps: (n,) left turn.
        lateral_mps: (n,) speed to the left.
        command: (all rows, 3) forward m/s, left turn rad/s, to the left m/s.

    Returns:
        The number of commands that were too fast, and of those that were not finite and so dropped, (arenas,) each.
    """
    robots = len(limits.kind)
    arenas = len(command) // robots
    clipped, not_finite = np.zeros(arenas, np.int64), np.zeros(arenas, np.int64)
    for k in range(len(rows)):
        if not drive[k]:
            continue
        row = rows[k]
        linear, angular, lateral = linear_mps[k], angular_radps[k], lateral_mps[k]
        if not (np.isfinite(linear) and np.isfinite(angular) and np.isfinite(lateral)):
            not_finite[row // robots] += 1
            continue
        if not alive[row]:
            continue
        i = row % robots
        linear, angular, lateral, too_fast = _within(limits, i, linear, angular, lateral)
        clipped[row // robots] += too_fast
        command[row, 0], command[row, 1], command[row, 2] = linear, angular, lateral
    return clipped, not_finite


@njit()
def _within(limits, i, linear, angular, lateral):
    """A command within the limits of robot index i, and whether it exceeded them."""
    kind, max_linear, max_angular = limits.kind[i], limits.max_linear_mps[i], limits.max_angular_radps[i]
    too_fast = lateral != 0.0 and kind != HOLONOMIC
    if kind != HOLONOMIC:
        lateral = 0.0
    if kind == DIFFERENTIAL:
        left, right = wheels_of_twist(linear, angular, limits.wheel_base_m[i])
        fastest = max(abs(left), abs(right))
        if fastest > max_linear * ROUNDING_FACTOR:
            return linear * (max_linear / fastest), angular * (max_linear / fastest), lateral, True
        return linear, angular, lateral, too_fast
    size = np.hypot(linear, lateral)
    if size > max_linear * ROUNDING_FACTOR:
        too_fast = True
        linear, lateral = linear * (max_linear / size), lateral * (max_linear / size)
    if abs(angular) > max_angular * ROUNDING_FACTOR:
        too_fast = True
        angular = max_angular if angular > 0.0 else -max_angular
    return linear, angular, lateral, too_fast


class NoisyWheels(NamedTuple):
    """The noise of all wheels, as in ARGoS: a wheel runs at f (w + b) in place of w, and stands still if both should.

    The bias b is drawn once for each wheel, the factor f for each wheel and tick.
    """

    noisy: BoolArray  # (robots,)
    factor: FloatArray  # (robots,) mean
    factor_std: FloatArray  # (robots,)
    bias_mps: FloatArray  # (arenas, robots, wheels)


def noisy_wheels_of(groups: Sequence[Group], keys: KeyArray) -> NoisyWheels:
    """The noise of the groups' wheels, with the biases of this run; `keys` (arenas,)."""
    sizes = [group.stop - group.start for group in groups]
    noise = [noise_of(group.body.drive) for group in groups]
    mean, spread = np.repeat([(each.bias_mps, each.bias_std_mps) for each in noise], sizes, axis=0).T[:, :, None]
    index, wheels = np.arange(len(mean))[:, None], np.array([LEFT, RIGHT])
    return NoisyWheels(
        np.repeat([each != NO_WHEEL_NOISE for each in noise], sizes),
        np.repeat([each.factor for each in noise], sizes),
        np.repeat([each.factor_std for each in noise], sizes),
        mean + spread * draws.normal(keys[:, None, None], index, 0, wheels, BIAS),
    )


def noise_of(drive: Drive) -> WheelNoise:
    """The noise of a drive's wheels; none if it has no wheels."""
    return NO_WHEEL_NOISE if isinstance(drive, Holonomic) else drive.noise


class FailedParts(NamedTuple):
    """Robots whose motors or wheels failed, (arenas, robots) each."""

    motors: BoolArray  # they brake
    left: BoolArray  # the left wheel stands still, the other turns
    right: BoolArray


@njit()
def drive_target(
    keys: KeyArray,
    wheel_base_m: FloatArray,
    noise: NoisyWheels,
    failed: FailedParts,
    tick: int,
    command: FloatArray,
    target: FloatArray,
) -> None:
    """Write the target of the engines in a tick, (arenas, robots, 3): `command` (rows, 3) with noise and failures."""
    arenas, robots = target.shape[:2]
    for arena in range(arenas):
        for i in range(robots):
            forward, turn, lateral = command[arena * robots + i]
            base_m = wheel_base_m[i]
            if noise.noisy[i] and (forward != 0.0 or turn != 0.0):
                left, right = wheels_of_twist(forward, turn, base_m)
                left = _factor(keys[arena], i, tick, LEFT, noise) * (left + noise.bias_mps[arena, i, LEFT])
                right = _factor(keys[arena], i, tick, RIGHT, noise) * (right + noise.bias_mps[arena, i, RIGHT])
                forward, turn = twist_of_wheels(left, right, base_m)
            if failed.motors[arena, i]:
                forward = turn = lateral = 0.0
            elif failed.left[arena, i] or failed.right[arena, i]:
                left, right = wheels_of_twist(forward, turn, base_m)  # also if noisy: rounding is that of any command
                left, right = 0.0 if failed.left[arena, i] else left, 0.0 if failed.right[arena, i] else right
                forward, turn = twist_of_wheels(left, right, base_m)
            target[arena, i, 0], target[arena, i, 1], target[arena, i, 2] = forward, turn, lateral


@njit()
def _factor(key, i, tick, wheel, noise):
    """The factor of a wheel's speed in a tick."""
    if noise.factor_std[i] == 0.0:
        return noise.factor[i]
    return noise.factor[i] + noise.factor_std[i] * normal(key, i, tick, wheel, FACTOR)


def fitting(table: SparseTable, places: IntArray, alive: BoolArray, not_there: IntArray) -> SparseTable:
    """The rows of robots that are `alive` (rows,) and have such a place: as many as `places` (robots,) says.

    Adds the number of rows without one to `not_there` (arenas,).
    """
    robots = len(places)
    there = table.slot < places[table.rows % robots]
    np.add.at(not_there, table.rows[~there] // robots, 1)
    return table.select(np.flatnonzero(there & alive[table.rows]))


class ShownLeds:
    """The LEDs of all robots: dark at the start, then as their agents switch them.

    Attributes:
        rgb: (arenas, robots, most LEDs of a robot) 0xRRGGBB, 0: dark or not there; written in place.
        told: (rows, most LEDs of a robot) a copy for observers: replaced after a change, never written to.
        not_there: (arenas,) changes of LEDs that their robots do not have.
    """

    def __init__(self, groups: Sequence[Group], arenas: int) -> None:
        self._count = np.repeat([group.body.led_count for group in groups], [each.stop - each.start for each in groups])
        self.rgb: IntArray = np.zeros((arenas, len(self._count), self._count.max(initial=0)), np.int64)
        self._row = self.rgb.reshape(arenas * len(self._count), self.rgb.shape[2])
        self.told = self._row.copy()
        self.not_there: IntArray = np.zeros(arenas, np.int64)

    def take(self, changes: SparseTable, alive: BoolArray) -> None:
        """Apply the changes of a tick to the LEDs of robots that are `alive` (rows,)."""
        if not len(changes):
            return
        changes = fitting(changes, self._count, alive, self.not_there)
        self._row[changes.rows, changes.slot] = changes.value
        self.told = self._row.copy()

    def tell(self) -> None:
        """Copy `rgb` for observers if it changed."""
        if not np.array_equal(self._row, self.told):
            self.told = self._row.copy()

    def darken(self, rows: BoolArray) -> None:
        """Switch off all LEDs of these robots (rows,)."""
        if self._row[rows].any():
            self._row[rows] = 0
            self.told = self._row.copy()


class Actuators:
    """The actuators of all robots.

    Attributes:
        command: (rows, 3) commands within the drives' limits: forward m/s, left turn rad/s, to the left m/s; replaced
            in each tick, never written to after.
        target: (arenas, robots, 3) the target of the engines: commands with noise and failures of wheels; in place.
        leds: the LEDs.
        failed: the failed motors and wheels.
        motors_off: (arenas, robots) flying bodies on the floor.
    """

    def __init__(self, groups: Sequence[Group], keys: KeyArray) -> None:
        """All stand still and are dark; `keys` (arenas,)."""
        self._keys, arenas, robots = keys, len(keys), groups[-1].stop
        self.command: FloatArray = np.zeros((arenas * robots, 3))
        self.target: FloatArray = np.zeros((arenas, robots, 3))
        self.leds = ShownLeds(groups, arenas)
        self.motors_off: BoolArray = np.zeros((arenas, robots), np.bool_)
        self._limits, self._noise = drive_limits_of(groups), noisy_wheels_of(groups, keys)
        self.fail({})
        self._ticks = 0
        self._clipped, self._not_finite = np.zeros(arenas, np.int64), np.zeros(arenas, np.int64)

    def take(self, actions: Actions, alive: BoolArray) -> None:
        """Apply the actions of a tick. Robots without a new command keep the last one.

        Robots that are not `alive` (rows,) ignore commands.
        """
        self.command = self.command.copy()
        commands = actions.rows, actions.drive, actions.linear_mps, actions.angular_radps, actions.lateral_mps
        clipped, not_finite = take_commands(self._limits, alive, *commands, self.command)
        self._clipped, self._not_finite = self._clipped + clipped, self._not_finite + not_finite
        if self._exact:
            self.target[:] = self.command.reshape(self.target.shape)
        else:
            errors = self._limits.wheel_base_m, self._noise, self.failed
            drive_target(self._keys, *errors, self._ticks, self.command, self.target)
        self.leds.take(actions.leds, alive)
        switched = actions.motors.select(np.flatnonzero(alive[actions.motors.rows]))
        self.motors_off.ravel()[switched.rows] = switched.value == 0.0
        self._ticks += 1

    def fail(self, failed: Mapping[str, BoolArray]) -> None:
        """Set the failed parts, by name (rows,); all others work."""
        none = np.zeros(self.target.shape[:2], np.bool_)
        parts = (failed[part].reshape(none.shape) if part in failed else none for part in (MOTORS, *WHEELS))
        self.failed = FailedParts(*parts)
        self._exact = not (self._noise.noisy.any() or any(part.any() for part in self.failed))

    def stop(self, dead: BoolArray) -> None:
        """Stop these robots (rows,) and switch off their LEDs; a flying body that is revived has its motors on."""
        self.command = np.where(dead[:, None], 0.0, self.command)
        self.leds.darken(dead)
        self.motors_off.ravel()[dead] = False

    def counts(self) -> dict[str, IntArray]:
        """Commands beyond the limits, commands that were not finite, and changes of LEDs that do not exist.

        By name, (arenas,) each.
        """
        commands = {"clipped_commands": self._clipped, "nan_commands": self._not_finite}
        return {**commands, "leds_not_there": self.leds.not_there}
