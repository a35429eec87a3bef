"""What a robot's agent senses: from the driver, and from a tracker what the driver does not give."""

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite, isnan, nan
from typing import Any

import numpy as np

from swarmwire.agent.drivers.driver import STOP, Command, Driver
from swarmwire.agent.host import AgentExecutor
from swarmwire.agent.on_robot.plan import SpeedLimits
from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.assignment import Assignment, GroupAssignment
from swarmwire.comms.bodies.body import Body
from swarmwire.comms.bodies.drives import Holonomic
from swarmwire.comms.draws import derive_key
from swarmwire.comms.packets import ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.tick_io import Actions, GroupReadings
from swarmwire.comms.wire.radio_bridge import Pose

NOT_SEEN = Pose(nan, nan, nan)  # as emulated senses read when a reading is lost
BATTERY = "battery"


class RobotSensors:
    """The senses that the agent needs, and the battery for whoever looks on, if the driver tells it.

    Attributes:
        pose: where the tracker saw the robot at the last reading; None: it did not, or there is no tracker.
        charge: the last charge of the battery, 0 to 1; None if it is not known.
        complete: whether there was a reading in which no sense was lost whole, the battery left out.
    """

    def __init__(
        self, driver: Driver, needs: frozenset[str], tracked: frozenset[str], own_pose: Callable[[], Pose | None]
    ) -> None:
        self._driver, self._tracked, self._own_pose = driver, tracked, own_pose
        self._asked = ((needs - tracked) | {BATTERY}) & driver.measures
        self.pose: Pose | None = None
        self.charge: float | None = None
        self.complete = False

    def read(self) -> dict[str, FloatArray]:
        """The fields of the senses, a row each; DriverLost if the robot does not answer."""
        fields = self._driver.sense(self._asked)
        if BATTERY in self._asked:
            charge = float(fields["battery.charge"][0])
            self.charge = charge if isfinite(charge) else None
        self.pose = self._own_pose()
        x_m, y_m, heading_rad = self.pose or NOT_SEEN
        if "positioning" in self._tracked:
            fields |= {"positioning.x_m": np.array([x_m]), "positioning.y_m": np.array([y_m])}
        if "compass" in self._tracked:
            fields["compass.heading_rad"] = np.array([heading_rad])
        if not self.complete:
            lost = [name for name, column in fields.items() if np.isnan(column).all()]
            self.complete = all(name.startswith(f"{BATTERY}.") for name in lost)
        return {name: _read_only(column) for name, column in fields.items()}


def _read_only(column: FloatArray) -> FloatArray:
    """As in emulation: a reading is the driver's, and no agent writes to it."""
    view = column.view()
    view.flags.writeable = False
    return view


# --- The agent of one robot: what it senses and hears goes in, what the robot is to do comes out.


@dataclass(frozen=True, slots=True)
class Decision:
    """What one robot does from this step on."""

    command: Command  # within the limits, with the LEDs that were switched in this step
    drive: bool  # whether the agent gave a command in this step; else the last one holds
    sent: SentPackets


class Controller:
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
        self, group: GroupAssignment, rate_hz: int, measures: tuple[str, ...] | None, limits: SpeedLimits
    ) -> None:
        """AgentFailed if the agent cannot be made."""
        self._host = AgentExecutor(Assignment((group,), rate_hz, measures))
        self._group, self._limits = group, limits
        self._sideways = isinstance(group.body.drive, Holonomic)
        self._command = STOP
        self.state = ""
        self.value: float | None = None
        self.leds: dict[int, int] = {}
        self.clipped = self.nan = self.actuations = 0

    def step(
        self, tick: int, fields: dict[str, FloatArray], received: ReceivedPackets, tx_status: TxStatuses
    ) -> Decision:
        """One step of the agent; AgentFailed with its traceback if it raises."""
        readings = {self._group.name: GroupReadings(self._group.rows, fields)}
        actions = self._host.act(tick, readings, received, tx_status)
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
