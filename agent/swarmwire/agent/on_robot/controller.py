"""The agent of one robot between its sensors and its commands.

`RobotSensors` reads the driver, and a tracker for the sensors that the driver lacks. `Controller` steps the agent with
these readings and turns its actions into a `Decision`: a command within the speed limits, and packets to send.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite, isnan, nan
from typing import Any

import numpy as np

from swarmwire.agent.drivers.driver import STOP, Command, Driver
from swarmwire.agent.executor import AgentExecutor
from swarmwire.agent.on_robot.plan import SpeedLimits
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.draws import derive_key
from swarmwire.comms.robot.bodies.body import Body
from swarmwire.comms.robot.bodies.drives import Holonomic
from swarmwire.comms.robot.packets import ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.robot.tick_io import NOTHING_SET, Actions, GroupReadings, SparseTable
from swarmwire.comms.wire.assignment import Assignment, GroupAssignment
from swarmwire.comms.wire.radio_bridge import Pose

NO_READING = Pose(nan, nan, nan)  # as emulated sensors read when a reading is lost
BATTERY = "battery"


class RobotSensors:
    """The sensors that the agent needs, and for observers the battery, if the driver reads it.

    Attributes:
        pose: the tracker's pose of the robot at the last reading; None without a tracker or a recent pose.
        charge: the last charge of the battery, 0 to 1; None if unknown.
        complete: whether, in one reading so far, no field but the battery's was lost as a whole.
    """

    def __init__(
        self, driver: Driver, needs: frozenset[str], tracked: frozenset[str], own_pose: Callable[[], Pose | None]
    ) -> None:
        self._driver, self._tracked, self._own_pose = driver, tracked, own_pose
        self._sensors = ((needs - tracked) | {BATTERY}) & driver.measures
        self.pose: Pose | None = None
        self.charge: float | None = None
        self.complete = False

    def read(self) -> dict[str, FloatArray]:
        """The fields of the sensors, one row each; DriverLost if the robot does not answer."""
        fields = self._driver.sense(self._sensors)
        if BATTERY in self._sensors:
            charge = float(fields["battery.charge"][0])
            self.charge = charge if isfinite(charge) else None
        self.pose = self._own_pose()
        x_m, y_m, heading_rad = self.pose or NO_READING
        if "positioning" in self._tracked:
            fields |= {"positioning.x_m": np.array([x_m]), "positioning.y_m": np.array([y_m])}
        if "compass" in self._tracked:
            fields["compass.heading_rad"] = np.array([heading_rad])
        if not self.complete:
            lost = [name for name, column in fields.items() if np.isnan(column).all()]
            self.complete = all(name.startswith(f"{BATTERY}.") for name in lost)
        return {name: _read_only(column) for name, column in fields.items()}


def _read_only(column: FloatArray) -> FloatArray:
    """A view that agents cannot write to, as in emulation: the reading belongs to the driver."""
    view = column.view()
    view.flags.writeable = False
    return view


@dataclass(frozen=True, slots=True)
class Decision:
    """The actions of one robot from this step on."""

    command: Command  # within the limits, with the LEDs that were switched in this step
    drive: bool  # whether the agent commanded a speed in this step; otherwise the last command holds
    sent: SentPackets
    states: SparseTable = NOTHING_SET  # that the agent noted
    values: SparseTable = NOTHING_SET  # numbers that it noted


class Controller:
    """Steps one agent, and keeps the actions that hold beyond a step.

    Attributes:
        state: the last state that the agent noted.
        value: the last number that it noted.
        leds: the colour of each LED that it ever switched.
        clipped: commands above the limits so far.
        nan: commands with nan so far.
        actuations: numbers so far for custom actuators, which no driver moves.
    """

    def __init__(
        self, group: GroupAssignment, rate_hz: int, measures: tuple[str, ...] | None, limits: SpeedLimits
    ) -> None:
        """AgentFailed if the agent cannot be made."""
        self._executor = AgentExecutor(Assignment((group,), rate_hz, measures))
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
        actions = self._executor.act(tick, readings, received, tx_status)
        drive = bool(actions.drive[0])
        if drive:
            self._take_command(actions)
        self.actuations += len(actions.actuators)
        if len(actions.notes):
            self.state = actions.notes.names[int(actions.notes.value[-1])]
        if len(actions.values):
            self.value = float(actions.values.value[-1])
        switched = dict(zip(actions.leds.slot.tolist(), actions.leds.integers.tolist(), strict=True))
        self.leds |= switched
        return Decision(self._with_leds(switched), drive, actions.sent, actions.notes, actions.values)

    def all_leds(self) -> Command:
        """The current command with every LED that the agent ever switched: for a robot that was off meanwhile."""
        return self._with_leds(self.leds)

    def _take_command(self, actions: Actions) -> None:
        """Take the command of a step; one with nan is counted, and the last one holds."""
        lateral = float(actions.lateral_mps[0]) if self._sideways else 0.0
        command = Command(float(actions.linear_mps[0]), float(actions.angular_radps[0]), lateral)
        if any(map(isnan, (command.linear_mps, command.angular_radps, command.lateral_mps))):
            self.nan += 1
            return
        self._command = self._limits.clipped(command)
        self.clipped += self._command is not command

    def _with_leds(self, leds: dict[int, int]) -> Command:
        command = self._command
        if not leds:
            return command
        return Command(command.linear_mps, command.angular_radps, command.lateral_mps, dict(leds))


def group_of(name: str, index: int, spec: str, params: dict[str, Any], body: Body, seed: int) -> GroupAssignment:
    """The assignment of one robot of a swarm; its draws are keyed by the seed and its index."""
    keys = np.array([derive_key("robot", seed, index)], np.uint64)
    return GroupAssignment("robot", spec, params, body.agent_view, np.array([index]), (name,), keys)
