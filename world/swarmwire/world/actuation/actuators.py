"""The actuators of all robots: drives with their limits, noise and failures, and LEDs. Compiled.

A command passes these steps in each tick: `take_commands` limits it to the drive, `NoisyWheels` adds the noise of
wheels, `FailedDrives` removes failed motors and wheels. The result is the target of the engines. `Actuators` joins the
steps.
"""

# pyright: basic, reportUnknownMemberType=false

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from swarmwire.comms import draws
from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray, KeyArray
from swarmwire.comms.bodies.body import MOTORS, WHEELS
from swarmwire.comms.bodies.drives import DRIVES, NO_WHEEL_NOISE, Drive, Holonomic, WheelNoise, wheel_base_of
from swarmwire.comms.draws_compiled import normal
from swarmwire.comms.kernels import njit
from swarmwire.comms.tick_io import Actions, LedChanges
from swarmwire.comms.truth import Group

DIFFERENTIAL, TWIST, HOLONOMIC = (list(DRIVES).index(kind) for kind in ("wheels", "twist", "holonomic"))
ROUNDING_FACTOR = 1.0 + 1e-9  # a command at exactly the limit is not clipped, despite rounding
BIAS, FACTOR = draws.purpose("wheel bias"), draws.purpose("wheel factor")
WHEEL_NOISE = np.arange(2)  # left and right


class DriveLimits(NamedTuple):
    """The speed limits of each robot index of an arena, (robots,) each."""

    kind: IntArray  # WHEELS, TWIST or HOLONOMIC
    half_base_m: FloatArray  # half the distance between the wheels; 0: it has none
    max_linear_mps: FloatArray  # of wheels that of a wheel, of a holonomic drive that of the planar vector
    max_angular_radps: FloatArray


def drive_limits_of(groups: Sequence[Group]) -> DriveLimits:
    """The limits of the groups' drives."""
    columns = [
        (
            list(DRIVES).index(drive.kind),
            0.5 * wheel_base_of(drive),
            drive.max_linear_mps,
            drive.max_angular_radps,
        )
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
        fastest = abs(linear) + abs(angular) * limits.half_base_m[i]
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


class NoisyWheels:
    """The noise of all wheels of all arenas, as in ARGoS: a wheel runs at f (w + b) in place of w.

    The bias b is drawn once for each wheel, the factor f for each wheel and tick. `any` is whether any wheel has noise.
    """

    def __init__(self, groups: Sequence[Group], keys: KeyArray) -> None:
        """The biases are drawn now; `keys` (arenas,)."""
        sizes = [group.stop - group.start for group in groups]
        noise = [noise_of(group.body.drive) for group in groups]
        self._keys = keys
        self._noisy = np.repeat([each != NO_WHEEL_NOISE for each in noise], sizes)
        self._wheel_base_m = np.repeat([wheel_base_of(group.body.drive) for group in groups], sizes)
        self._factor = np.repeat([each.factor for each in noise], sizes)
        self._factor_std = np.repeat([each.factor_std for each in noise], sizes)
        mean, spread = np.repeat([(each.bias_mps, each.bias_std_mps) for each in noise], sizes, axis=0).T[:, :, None]
        index = np.arange(len(mean))
        self._bias_mps = mean + spread * draws.normal(keys[:, None, None], index[:, None], 0, WHEEL_NOISE, BIAS)
        self.any = bool(self._noisy.any())

    def act(self, tick: int, target: FloatArray) -> None:
        """Apply the noise to the target of the engines in a tick, (arenas, robots, 3), in place."""
        spread = self._wheel_base_m, self._factor, self._factor_std, self._bias_mps
        _act_noise(self._keys, self._noisy, *spread, tick, target)


def noise_of(drive: Drive) -> WheelNoise:
    """The noise of a drive's wheels; none if it has no wheels."""
    return NO_WHEEL_NOISE if isinstance(drive, Holonomic) else drive.noise


@njit()
def _act_noise(keys, noisy, wheel_base_m, factor, factor_std, bias_mps, tick, target):
    for arena in range(target.shape[0]):
        for i in range(target.shape[1]):
            forward, turn = target[arena, i, 0], target[arena, i, 1]
            if not noisy[i] or (forward == 0.0 and turn == 0.0):
                continue
            half = 0.5 * wheel_base_m[i] * turn
            left = _factor(keys[arena], i, tick, 0, factor, factor_std) * (forward - half + bias_mps[arena, i, 0])
            right = _factor(keys[arena], i, tick, 1, factor, factor_std) * (forward + half + bias_mps[arena, i, 1])
            target[arena, i, 0] = 0.5 * (left + right)
            target[arena, i, 1] = (right - left) / wheel_base_m[i]


@njit()
def _factor(key, i, tick, wheel, factor, factor_std):
    """The factor of a wheel's speed in a tick."""
    if factor_std[i] == 0.0:
        return factor[i]
    return factor[i] + factor_std[i] * normal(key, i, tick, wheel, FACTOR)


class FailedDrives:
    """The failed motors and wheels of all arenas: failed motors brake, a failed wheel stands still, the other turns.

    Attributes:
        motors: (arenas, robots) whose motors failed.
        any: whether any motor or wheel failed.
    """

    def __init__(self, groups: Sequence[Group], arenas: int) -> None:
        """All of them work."""
        sizes = [group.stop - group.start for group in groups]
        self._wheel_base_m = np.repeat([wheel_base_of(group.body.drive) for group in groups], sizes)
        self._shape = arenas, sum(sizes)
        self.fail({})

    def fail(self, failed: Mapping[str, BoolArray]) -> None:
        """Set the failed parts, by name (rows,); all others work."""
        none = np.zeros(self._shape, np.bool_)
        masks = [failed[part].reshape(self._shape) if part in failed else none for part in (MOTORS, *WHEELS)]
        self.motors: BoolArray = masks[0]
        self._left, self._right = masks[1], masks[2]
        self.any = any(bool(mask.any()) for mask in masks)

    def act(self, target: FloatArray) -> None:
        """Apply the failures to the target of the engines, (arenas, robots, 3), in place."""
        _act_failures(self.motors, self._left, self._right, self._wheel_base_m, target)


@njit()
def _act_failures(motors, left_failed, right_failed, wheel_base_m, target):
    for arena in range(target.shape[0]):
        for i in range(target.shape[1]):
            if motors[arena, i]:
                target[arena, i] = 0.0
            elif left_failed[arena, i] or right_failed[arena, i]:
                forward, half = target[arena, i, 0], 0.5 * wheel_base_m[i] * target[arena, i, 1]
                left = 0.0 if left_failed[arena, i] else forward - half
                right = 0.0 if right_failed[arena, i] else forward + half
                target[arena, i, 0] = 0.5 * (left + right)
                target[arena, i, 1] = (right - left) / wheel_base_m[i]


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

    def take(self, changes: LedChanges, alive: BoolArray) -> None:
        """Apply the changes of a tick to the LEDs of robots that are `alive` (rows,)."""
        if not len(changes):
            return
        there = changes.which < self._count[changes.rows % len(self._count)]
        np.add.at(self.not_there, changes.rows[~there] // len(self._count), 1)
        there &= alive[changes.rows]
        self._row[changes.rows[there], changes.which[there]] = changes.rgb[there]
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
    """

    def __init__(self, groups: Sequence[Group], keys: KeyArray) -> None:
        """All stand still and are dark; `keys` (arenas,)."""
        arenas, robots = len(keys), groups[-1].stop
        self.command: FloatArray = np.zeros((arenas * robots, 3))
        self.target: FloatArray = np.zeros((arenas, robots, 3))
        self.leds = ShownLeds(groups, arenas)
        self.failed = FailedDrives(groups, arenas)
        self._limits, self._noise = drive_limits_of(groups), NoisyWheels(groups, keys)
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
        self.target[:] = self.command.reshape(self.target.shape)
        if self._noise.any:
            self._noise.act(self._ticks, self.target)
        if self.failed.any:
            self.failed.act(self.target)
        self.leds.take(actions.leds, alive)
        self._ticks += 1

    def stop(self, dead: BoolArray) -> None:
        """Stop these robots (rows,) and switch off their LEDs."""
        self.command = np.where(dead[:, None], 0.0, self.command)
        self.leds.darken(dead)

    def counts(self) -> dict[str, IntArray]:
        """Commands beyond the limits, commands that were not finite, and changes of LEDs that do not exist.

        By name, (arenas,) each.
        """
        commands = {"clipped_commands": self._clipped, "nan_commands": self._not_finite}
        return {**commands, "leds_not_there": self.leds.not_there}
