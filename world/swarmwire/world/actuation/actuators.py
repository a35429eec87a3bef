"""What agents ask of motors and LEDs, and what becomes of it."""

from collections.abc import Sequence

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray, KeyArray
from swarmwire.comms.tick_io import Actions
from swarmwire.comms.truth import Group
from swarmwire.world.actuation.failures import FailedDrives
from swarmwire.world.actuation.limits import limits_of, take_commands
from swarmwire.world.actuation.noise import NoisyWheels
from swarmwire.world.actuation.shown_leds import ShownLeds


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
        self._limits, self._noise = limits_of(groups), NoisyWheels(groups, keys)
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
