"""The actuators of all robots: drives with their limits, noise and failures, and LEDs. Compiled.

A command passes two kernels in each tick: `limit_commands` limits it to the drive; `drive_target` turns it into the
target of the engines, through the speeds of wheels if these are noisy or have failed.
"""

# pyright: basic, reportUnknownMemberType=false

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from swarmwire.comms.base import draws
from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray, KeyArray
from swarmwire.comms.base.draws_compiled import normal
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.base.math import compiled as math_compiled
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
    wheel_base_m: FloatArray  # 0: no wheels
    max_linear_mps: FloatArray  # the greatest speed of a wheel; of a holonomic drive, that of the planar vector
    max_angular_radps: FloatArray


def drive_limits_of(groups: Sequence[Group]) -> DriveLimits:
    """Return the limits of the groups' drives."""
    columns = [
        (list(DRIVES).index(drive.kind), wheel_base_of(drive), drive.max_linear_mps, drive.max_angular_radps)
        for drive in (group.body.drive for group in groups)
    ]
    sizes = [group.stop - group.start for group in groups]
    return DriveLimits(*(np.repeat(np.array(column), sizes) for column in zip(*columns, strict=True)))


class NewCommands(NamedTuple):
    """The commands of one tick, (n,) each."""

    rows: IntArray  # robot row of each command
    drive: BoolArray  # False: no command
    linear_mps: FloatArray  # forward speed
    angular_radps: FloatArray  # left turn
    lateral_mps: FloatArray  # speed to the left


@njit()
def limit_commands(
    limits: DriveLimits, alive: BoolArray, new: NewCommands, command: FloatArray
) -> tuple[IntArray, IntArray]:
    """Limit new commands to the drives, and write them to `command`, over the last commands.

    A differential drive scales both speeds by one factor, so that the curve stays the same. A twist drive cuts each
    speed to its own limit. A holonomic drive scales the planar vector, so that the direction stays, and cuts the turn.
    Bodies with wheels do not move sideways.

    Args:
        limits: the limits of each robot index.
        alive: (rows,) robots that obey commands.
        new: the commands of the tick.
        command: (rows, 3) forward m/s, left turn rad/s, to the left m/s.

    Returns:
        The number of commands that were too fast, and of commands dropped as not finite, (arenas,) each.
    """
    robots = len(limits.kind)
    arenas = len(command) // robots
    clipped, not_finite = np.zeros(arenas, np.int64), np.zeros(arenas, np.int64)
    for k in range(len(new.rows)):
        if not new.drive[k]:
            continue
        row = new.rows[k]
        linear, angular, lateral = new.linear_mps[k], new.angular_radps[k], new.lateral_mps[k]
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
    """Return a command within the limits of robot index i, and True if it exceeded them."""
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
    size = math_compiled.hypot(linear, lateral)
    if size > max_linear * ROUNDING_FACTOR:
        too_fast = True
        linear, lateral = linear * (max_linear / size), lateral * (max_linear / size)
    if abs(angular) > max_angular * ROUNDING_FACTOR:
        too_fast = True
        angular = max_angular if angular > 0.0 else -max_angular
    return linear, angular, lateral, too_fast


class NoisyWheels(NamedTuple):
    """The noise of all wheels, that of ARGoS: a wheel commanded to w runs at f (w + b); at command 0 both stand still.

    The bias b is drawn once for each wheel, the factor f for each wheel and tick.
    """

    noisy: BoolArray  # (robots,)
    factor: FloatArray  # (robots,) mean
    factor_std: FloatArray  # (robots,)
    bias_mps: FloatArray  # (arenas, robots, wheels)


def noisy_wheels_of(groups: Sequence[Group], keys: KeyArray) -> NoisyWheels:
    """Return the noise of the groups' wheels, with the biases of this run; `keys` (arenas,)."""
    sizes = [group.stop - group.start for group in groups]
    noises = [noise_of(group.body.drive) for group in groups]
    mean, spread = np.repeat([(noise.bias_mps, noise.bias_std_mps) for noise in noises], sizes, axis=0).T[:, :, None]
    index, wheels = np.arange(len(mean))[:, None], np.array([LEFT, RIGHT])
    return NoisyWheels(
        np.repeat([noise != NO_WHEEL_NOISE for noise in noises], sizes),
        np.repeat([noise.factor for noise in noises], sizes),
        np.repeat([noise.factor_std for noise in noises], sizes),
        mean + spread * draws.normal(keys[:, None, None], index, 0, wheels, BIAS),
    )


def noise_of(drive: Drive) -> WheelNoise:
    """Return the noise of a drive's wheels; NO_WHEEL_NOISE without wheels."""
    return NO_WHEEL_NOISE if isinstance(drive, Holonomic) else drive.noise


class FailedParts(NamedTuple):
    """Robots whose motors or wheels failed, (arenas, robots) each."""

    motors: BoolArray  # failed motors brake
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
                left, right = wheels_of_twist(forward, turn, base_m)  # again if noisy: rounding is that of a command
                left, right = 0.0 if failed.left[arena, i] else left, 0.0 if failed.right[arena, i] else right
                forward, turn = twist_of_wheels(left, right, base_m)
            target[arena, i, 0], target[arena, i, 1], target[arena, i, 2] = forward, turn, lateral


@njit()
def _factor(key, i, tick, wheel, noise):
    """Return the factor of a wheel's speed in a tick."""
    if noise.factor_std[i] == 0.0:
        return noise.factor[i]
    return noise.factor[i] + noise.factor_std[i] * normal(key, i, tick, wheel, FACTOR)


def select_existing(table: SparseTable, counts: IntArray, alive: BoolArray, missing: IntArray) -> SparseTable:
    """Select the rows of robots that are `alive` (rows,), for an LED or number that the robot has.

    Args:
        table: the rows.
        counts: (robots,) how many LEDs or numbers each robot has.
        alive: (rows,).
        missing: (arenas,) the number of rows for others is added.
    """
    robots = len(counts)
    exists = table.slot < counts[table.rows % robots]
    np.add.at(missing, table.rows[~exists] // robots, 1)
    return table.select(np.flatnonzero(exists & alive[table.rows]))


class LedStates:
    """The LEDs of all robots: dark at the start, then switched by agents.

    Attributes:
        rgb: (arenas, robots, LEDs) 0xRRGGBB, 0: dark or missing; written in place.
        published: (rows, LEDs) a copy for observers: replaced after a change, never written to.
        missing: (arenas,) number of changes of LEDs that their robots do not have.
    """

    def __init__(self, groups: Sequence[Group], arenas: int) -> None:
        sizes = [group.stop - group.start for group in groups]
        self._counts = np.repeat([group.body.led_count for group in groups], sizes)
        self.rgb: IntArray = np.zeros((arenas, len(self._counts), self._counts.max(initial=0)), np.int64)
        self._row = self.rgb.reshape(arenas * len(self._counts), self.rgb.shape[2])
        self.published = self._row.copy()
        self.missing: IntArray = np.zeros(arenas, np.int64)

    def apply(self, changes: SparseTable, alive: BoolArray) -> None:
        """Apply the changes of a tick to the LEDs of robots that are `alive` (rows,)."""
        if not len(changes):
            return
        changes = select_existing(changes, self._counts, alive, self.missing)
        self._row[changes.rows, changes.slot] = changes.value
        self.published = self._row.copy()

    def publish(self) -> None:
        """Copy `rgb` for observers if it changed."""
        if not np.array_equal(self._row, self.published):
            self.published = self._row.copy()

    def darken(self, rows: BoolArray) -> None:
        """Switch off all LEDs of these robots (rows,)."""
        if self._row[rows].any():
            self._row[rows] = 0
            self.published = self._row.copy()


class Actuators:
    """The actuators of all robots.

    Attributes:
        command: (rows, 3) commands within the drives' limits: forward m/s, left turn rad/s, to the left m/s; replaced
            in each tick, never written to after.
        target: (arenas, robots, 3) the target of the engines: commands with noise and failures of wheels; in place.
        leds: the LEDs.
        failed: the failed motors and wheels.
        motors_off: (arenas, robots) True: a flying body that stands on the floor.
    """

    def __init__(self, groups: Sequence[Group], keys: KeyArray) -> None:
        """Make actuators that stand still and are dark; `keys` (arenas,)."""
        self._keys, arenas, robots = keys, len(keys), groups[-1].stop
        self.command: FloatArray = np.zeros((arenas * robots, 3))
        self.target: FloatArray = np.zeros((arenas, robots, 3))
        self.leds = LedStates(groups, arenas)
        self.motors_off: BoolArray = np.zeros((arenas, robots), np.bool_)
        self._limits, self._noise = drive_limits_of(groups), noisy_wheels_of(groups, keys)
        self.set_failed({})
        self._ticks = 0
        self._clipped, self._not_finite = np.zeros(arenas, np.int64), np.zeros(arenas, np.int64)
        followed = np.repeat([group.followed for group in groups], [group.stop - group.start for group in groups])
        self._followed: BoolArray = np.tile(followed, arenas)  # (rows,) robots that do not drive
        self._any_followed, self._ignored = bool(followed.any()), np.zeros(arenas, np.int64)

    def apply(self, actions: Actions, alive: BoolArray) -> None:
        """Apply the actions of a tick. Robots without a new command keep the last one.

        Robots that are not `alive` (rows,), or that a source moves, ignore commands.
        """
        self.command, drive = self.command.copy(), actions.drive
        if self._any_followed:
            ignored = drive & self._followed[actions.rows]
            np.add.at(self._ignored, actions.rows[ignored] // self.target.shape[1], 1)
            drive = drive & ~ignored
        new = NewCommands(actions.rows, drive, actions.linear_mps, actions.angular_radps, actions.lateral_mps)
        clipped, not_finite = limit_commands(self._limits, alive, new, self.command)
        self._clipped, self._not_finite = self._clipped + clipped, self._not_finite + not_finite
        if self._exact:
            self.target[:] = self.command.reshape(self.target.shape)
        else:
            wheel_base_m, noise, failed = self._limits.wheel_base_m, self._noise, self.failed
            drive_target(self._keys, wheel_base_m, noise, failed, self._ticks, self.command, self.target)
        self.leds.apply(actions.leds, alive)
        switched = actions.motors.select(np.flatnonzero(alive[actions.motors.rows]))
        self.motors_off.ravel()[switched.rows] = switched.value == 0.0
        self._ticks += 1

    def set_failed(self, failed: Mapping[str, BoolArray]) -> None:
        """Set the robots (rows,) whose parts have failed, by the part's name; all others work."""
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
        """Return the number of clipped, not finite and ignored commands, and of changes of missing LEDs, by name.

        Each is (arenas,). Robots that a source moves ignore commands.
        """
        commands = {"clipped_commands": self._clipped, "nan_commands": self._not_finite}
        commands["commands_to_followed"] = self._ignored
        return {**commands, "leds_not_there": self.leds.missing}
