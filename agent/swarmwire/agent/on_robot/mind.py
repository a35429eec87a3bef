"""The agent of one robot: what it senses and hears goes in, what the robot is to do comes out."""

from dataclasses import dataclass
from math import isnan
from typing import Any

import numpy as np

from swarmwire.agent.drivers.driver import STOP, Command
from swarmwire.agent.host import Host
from swarmwire.agent.on_robot.limits import SpeedLimits
from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.assignment import Assignment, GroupAssignment
from swarmwire.comms.bodies.body import Body
from swarmwire.comms.bodies.drives import Holonomic
from swarmwire.comms.draws import derive_key
from swarmwire.comms.packets import Heard, Outcomes, Sent
from swarmwire.comms.tick_io import Actions, GroupSenses


@dataclass(frozen=True, slots=True)
class Decision:
    """What one robot does from this step on."""

    command: Command  # within the limits, with the LEDs that were switched in this step
    drive: bool  # whether the agent gave a command in this step; else the last one holds
    sent: Sent


class Mind:
    """The host of one agent, and what of its deeds holds beyond the step.

    Attributes:
        state: the last state that the agent named.
        value: the last number that it told.
        leds: the colour of each LED that it ever switched.
        clipped: commands above the limits so far.
        nan: commands that were none.
        actuations: numbers told to actuators of the user's own, of which no driver knows.
    """

    def __init__(
        self, group: GroupAssignment, rate_hz: int, gives: tuple[str, ...] | None, limits: SpeedLimits
    ) -> None:
        """AgentFailed if the agent cannot be made."""
        self._host = Host(Assignment((group,), rate_hz, gives))
        self._group, self._limits = group, limits
        self._sideways = isinstance(group.body.drive, Holonomic)
        self._command = STOP
        self.state = ""
        self.value: float | None = None
        self.leds: dict[int, int] = {}
        self.clipped = self.nan = self.actuations = 0

    def step(self, tick: int, fields: dict[str, FloatArray], heard: Heard, outcomes: Outcomes) -> Decision:
        """One step of the agent; AgentFailed with its traceback if it raises."""
        senses = {self._group.name: GroupSenses(self._group.rows, fields)}
        actions = self._host.act(tick, senses, heard, outcomes)
        drive = bool(actions.drive[0])
        if drive:
            self._follow(actions)
        self.actuations += len(actions.own)
        if len(actions.notes):
            self.state = actions.notes.names[int(actions.notes.code[-1])]
        if len(actions.values):
            self.value = float(actions.values.value[-1])
        switched = dict(zip(actions.leds.which.tolist(), actions.leds.rgb.tolist(), strict=True))
        self.leds |= switched
        return Decision(self._with_leds(switched), drive, actions.sent)

    def all_leds(self) -> Command:
        """The command that holds, with every LED that the agent ever switched: for a robot that forgot them."""
        return self._with_leds(self.leds)

    def _follow(self, actions: Actions) -> None:
        """Take the command of a step; nan is none, and the last one holds."""
        lateral = float(actions.lateral_mps[0]) if self._sideways else 0.0
        asked = Command(float(actions.linear_mps[0]), float(actions.angular_radps[0]), lateral)
        if any(map(isnan, (asked.linear_mps, asked.angular_radps, asked.lateral_mps))):
            self.nan += 1
            return
        self._command = self._limits.clipped(asked)
        self.clipped += self._command is not asked

    def _with_leds(self, leds: dict[int, int]) -> Command:
        command = self._command
        if not leds:
            return command
        return Command(command.linear_mps, command.angular_radps, command.lateral_mps, dict(leds))


def group_of(name: str, index: int, spec: str, params: dict[str, Any], body: Body, seed: int) -> GroupAssignment:
    """The assignment of one robot of a swarm, with draws of its own."""
    keys = np.array([derive_key("robot", seed, index)], np.uint64)
    return GroupAssignment("robot", spec, params, body.told, np.array([index]), (name,), keys)
