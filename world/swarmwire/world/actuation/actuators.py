"""What drives can follow of what agents ask for: each kind of drive clips commands in its own way. Compiled."""

# pyright: basic, reportUnknownMemberType=false

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numba import njit

from swarmwire.comms import draws
from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray, KeyArray
from swarmwire.comms.bodies.body import MOTORS, WHEELS
from swarmwire.comms.bodies.drives import DRIVES, NO_WHEEL_NOISE, Drive, Holonomic, WheelNoise, wheel_base_of
from swarmwire.comms.draws_compiled import normal
from swarmwire.comms.tick_io import Actions, LedChanges
from swarmwire.comms.truth import Group

DIFFERENTIAL, TWIST, HOLONOMIC = (list(DRIVES).index(kind) for kind in ("wheels", "twist", "holonomic"))
ROUNDED = 1.0 + 1e-9  # a command that asks for exactly the limit and was rounded is not clipped


class DriveLimits(NamedTuple):
    """How fast each robot index of an arena can go, (robots,) each."""

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


@njit(cache=True)
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
    """Write what drives can follow of new commands into `command` (rows, 3), which holds the last ones.

    Two wheels shrink both speeds by one factor, so that the curve stays the same; a twist drive cuts each speed to its
    own limit; a holonomic one shrinks the planar vector, so that the direction stays, and cuts the turn. Bodies with
    wheels do not move sideways.

    Args:
        limits: of each robot index.
        alive: (all rows,).
        rows: (n,) robot row of each command.
        drive: (n,) False: no command.
        linear_mps: (n,) forward speed asked for.
        angular_radps: (n,) left turn asked for.
        lateral_mps: (n,) speed to the left asked for.
        command: (all rows, 3) forward m/s, left turn rad/s, to the left m/s.

    Returns:
        How many commands were too fast, and how many were not finite and so dropped, (arenas,) each.
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


@njit(cache=True)
def _within(limits, i, linear, angular, lateral):
    """What the drive of robot index i can follow of a command, and whether it asked for more."""
    kind, most, most_turn = limits.kind[i], limits.max_linear_mps[i], limits.max_angular_radps[i]
    too_fast = lateral != 0.0 and kind != HOLONOMIC
    if kind != HOLONOMIC:
        lateral = 0.0
    if kind == DIFFERENTIAL:
        fastest = abs(linear) + abs(angular) * limits.half_base_m[i]
        if fastest > most * ROUNDED:
            return linear * (most / fastest), angular * (most / fastest), lateral, True
        return linear, angular, lateral, too_fast
    size = np.hypot(linear, lateral)
    if size > most * ROUNDED:
        too_fast = True
        linear, lateral = linear * (most / size), lateral * (most / size)
    if abs(angular) > most_turn * ROUNDED:
        too_fast = True
        angular = most_turn if angular > 0.0 else -most_turn
    return linear, angular, lateral, too_fast


# --- Wheels that do not run as they are asked to, as in ARGoS: at f (w + b) in place of w. Compiled.
#
# The bias b is drawn once for each wheel, the factor f for each wheel and tick.


BIAS, FACTOR = draws.purpose("wheel bias"), draws.purpose("wheel factor")
WHEEL_NOISE = np.arange(2)  # left and right


class NoisyWheels:
    """The noise of all wheels of all arenas; `any` tells whether there is some."""

    def __init__(self, groups: Sequence[Group], keys: KeyArray) -> None:
        """The biases are drawn now; `keys` (arenas,)."""
        sizes = [group.stop - group.start for group in groups]
        noise = [noise_of(group.body.drive) for group in groups]
        self._keys = keys
        self._noisy = np.repeat([of != NO_WHEEL_NOISE for of in noise], sizes)
        self._wheel_base_m = np.repeat([wheel_base_of(group.body.drive) for group in groups], sizes)
        self._factor = np.repeat([of.factor for of in noise], sizes)
        self._factor_std = np.repeat([of.factor_std for of in noise], sizes)
        mean, spread = np.repeat([(of.bias_mps, of.bias_std_mps) for of in noise], sizes, axis=0).T[:, :, None]
        index = np.arange(len(mean))
        self._bias_mps = mean + spread * draws.normal(keys[:, None, None], index[:, None], 0, WHEEL_NOISE, BIAS)
        self.any = bool(self._noisy.any())

    def act(self, tick: int, target: FloatArray) -> None:
        """Change what engines are given in a tick, (arenas, robots, 3), to what the wheels make of it."""
        spread = self._wheel_base_m, self._factor, self._factor_std, self._bias_mps
        _act_noise(self._keys, self._noisy, *spread, tick, target)


def noise_of(drive: Drive) -> WheelNoise:
    """The noise of a drive's wheels; none if it has no wheels."""
    return NO_WHEEL_NOISE if isinstance(drive, Holonomic) else drive.noise


@njit(cache=True)
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


@njit(cache=True)
def _factor(key, i, tick, wheel, factor, factor_std):
    """By what a wheel's speed is multiplied in a tick."""
    if factor_std[i] == 0.0:
        return factor[i]
    return factor[i] + factor_std[i] * normal(key, i, tick, wheel, FACTOR)


# --- Motors and wheels that failed: motors brake, a wheel stands still while the other goes on. Compiled.


class FailedDrives:
    """The motors and wheels of all arenas that do not work.

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
        """From now on these parts do not work, by name (rows,), and all others do."""
        none = np.zeros(self._shape, np.bool_)
        masks = [failed[part].reshape(self._shape) if part in failed else none for part in (MOTORS, *WHEELS)]
        self.motors: BoolArray = masks[0]
        self._left, self._right = masks[1], masks[2]
        self.any = any(bool(mask.any()) for mask in masks)

    def act(self, target: FloatArray) -> None:
        """Change what engines are given, (arenas, robots, 3), to what is left of it."""
        _act_failures(self.motors, self._left, self._right, self._wheel_base_m, target)


@njit(cache=True)
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


# --- What the LEDs of all robots show.


class ShownLeds:
    """The LEDs of all robots: dark at the start, and then as their agents switch them.

    Attributes:
        rgb: (arenas, robots, most LEDs of a robot) 0xRRGGBB, 0: dark or not there; written in place.
        told: (rows, most LEDs of a robot) the same for observers: replaced when something changes, never written to.
        not_there: (arenas,) changes of LEDs that their robots do not have.
    """

    def __init__(self, groups: Sequence[Group], arenas: int) -> None:
        self._count = np.repeat([group.body.led_count for group in groups], [of.stop - of.start for of in groups])
        self.rgb: IntArray = np.zeros((arenas, len(self._count), self._count.max(initial=0)), np.int64)
        self._row = self.rgb.reshape(arenas * len(self._count), self.rgb.shape[2])
        self.told = self._row.copy()
        self.not_there: IntArray = np.zeros(arenas, np.int64)

    def take(self, changes: LedChanges, alive: BoolArray) -> None:
        """Switch what agents of robots `alive` (rows,) switched in a tick."""
        if not len(changes):
            return
        there = changes.which < self._count[changes.rows % len(self._count)]
        np.add.at(self.not_there, changes.rows[~there] // len(self._count), 1)
        there &= alive[changes.rows]
        self._row[changes.rows[there], changes.which[there]] = changes.rgb[there]
        self.told = self._row.copy()

    def tell(self) -> None:
        """Tell observers what was written to `rgb`."""
        if not np.array_equal(self._row, self.told):
            self.told = self._row.copy()

    def darken(self, rows: BoolArray) -> None:
        """These robots (rows,) go dark."""
        if self._row[rows].any():
            self._row[rows] = 0
            self.told = self._row.copy()


# --- What agents ask of motors and LEDs, and what becomes of it.


class Actuators:
    """The actuators of all robots.

    Attributes:
        command: (rows, 3) asked for, within the drives' limits: forward m/s, left turn rad/s, to the left m/s; replaced
            in each tick, never written to after.
        target: (arenas, robots, 3) the same with noise and failures of wheels: what engines are given; in place.
        leds: what the LEDs show.
        failed: motors and wheels that do not work.
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
        """Take what agents decided in a tick. Robots without a new command keep the last one.

        Those that are not `alive` (rows,) do nothing.
        """
        self.command = self.command.copy()
        asked = actions.rows, actions.drive, actions.linear_mps, actions.angular_radps, actions.lateral_mps
        clipped, not_finite = take_commands(self._limits, alive, *asked, self.command)
        self._clipped, self._not_finite = self._clipped + clipped, self._not_finite + not_finite
        self.target[:] = self.command.reshape(self.target.shape)
        if self._noise.any:
            self._noise.act(self._ticks, self.target)
        if self.failed.any:
            self.failed.act(self.target)
        self.leds.take(actions.leds, alive)
        self._ticks += 1

    def stop(self, dead: BoolArray) -> None:
        """These robots (rows,) stand still and are dark."""
        self.command = np.where(dead[:, None], 0.0, self.command)
        self.leds.darken(dead)

    def counts(self) -> dict[str, IntArray]:
        """Commands that drives could not follow, or that were not finite and so dropped; LEDs that are not there.

        By name, (arenas,) each.
        """
        commands = {"clipped_commands": self._clipped, "nan_commands": self._not_finite}
        return {**commands, "leds_not_there": self.leds.not_there}
