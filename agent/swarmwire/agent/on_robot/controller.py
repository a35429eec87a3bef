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

NO_READING = Pose(nan, nan, nan)  # same as a lost reading of emulated sensors
BATTERY = "battery"


class RobotSensors:
    """The sensors that the agent needs, and the battery for observers, if the driver reads it.

    Attributes:
        pose: the tracker's pose of the robot at the last reading; None without a tracker or a recent pose.
        charge: the last charge of the battery, 0 to 1; None if unknown.
        complete: True once a reading had values in every field, apart from the battery's.
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
        """Return the fields of the sensors, one row each; DriverLost if the robot does not answer."""
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
            missing = [name for name, column in fields.items() if np.isnan(column).all()]
            self.complete = all(name.startswith(f"{BATTERY}.") for name in missing)
        return {name: _read_only(column) for name, column in fields.items()}


def _read_only(column: FloatArray) -> FloatArray:
    """Return a read-only view, as agents get in emulation; the array belongs to the driver."""
    view = column.view()
    view.flags.writeable = False
    return view


@dataclass(frozen=True, slots=True)
class Decision:
    """The actions of one robot in a step."""

    command: Command  # within the limits, with the LEDs that were switched in this step
    drive: bool  # True if the agent commanded a speed in this step; otherwise the last command stays
    sent: SentPackets
    states: SparseTable = NOTHING_SET  # noted states
    values: SparseTable = NOTHING_SET  # noted numbers


class Controller:
    """Steps one agent, and keeps the actions that last beyond a step.

    Attributes:
        state: the last noted state.
        value: the last noted number.
        leds: the colour of each LED that the agent ever switched.
        clipped: commands above the limits so far.
        nan: commands with nan so far.
        actuations: numbers for custom actuators so far, which no driver moves.
    """

    def __init__(
        self, group: GroupAssignment, rate_hz: int, measures: tuple[str, ...] | None, limits: SpeedLimits
    ) -> None:
        """Construct the agent; AgentFailed if that fails."""
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
        """Step the agent, and return its decision; AgentFailed with its traceback if it raises."""
        readings = {self._group.name: GroupReadings(self._group.rows, fields)}
        actions = self._executor.act(tick, readings, received, tx_status)
        drive = bool(actions.drive[0])
        if drive:
            self._store_command(actions)
        self.actuations += len(actions.actuators)
        if len(actions.notes):
            self.state = actions.notes.names[int(actions.notes.value[-1])]
        if len(actions.values):
            self.value = float(actions.values.value[-1])
        switched = dict(zip(actions.leds.slot.tolist(), actions.leds.integers.tolist(), strict=True))
        self.leds |= switched
        return Decision(self._with_leds(switched), drive, actions.sent, actions.notes, actions.values)

    def all_leds(self) -> Command:
        """Return the current command with every LED ever switched, for a robot that was off meanwhile."""
        return self._with_leds(self.leds)

    def _store_command(self, actions: Actions) -> None:
        """Store the command of a step; a command with nan is counted, and the last one stays."""
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
    """Return the assignment of one robot of a swarm; its draws are keyed by the seed and its index."""
    keys = np.array([derive_key("robot", seed, index)], np.uint64)
    return GroupAssignment("robot", spec, params, body.agent_view, np.array([index]), (name,), keys)
