"""Robot: the handle through which an Agent's step reads and moves its robot, and uses its radio."""

from typing import Any, TypeVar, cast, overload

import numpy as np
from numpy.typing import ArrayLike

from swarmwire.agent.packet import Packet, TxStatus
from swarmwire.agent.robots import Draw, RobotHandle
from swarmwire.agent.step_context import StepContext
from swarmwire.comms.robot.bodies.drives import rgb_of_one, twist_of_wheels
from swarmwire.comms.robot.messages import DICT_TAG, Message, dict_in, encode_dict, message_class
from swarmwire.comms.robot.packets import TxResult
from swarmwire.comms.robot.sensors.sensor import CustomReading, SensorProperty

M = TypeVar("M", bound=Message)


class Robot(RobotHandle[float]):
    """One robot in one tick. Sensors raise NotDeclared unless the agent's `needs` name them."""

    __slots__ = ("_draw", "_row", "radio")

    def __init__(self, context: StepContext, row: int) -> None:
        super().__init__(context)
        self._row = row
        self._draw: Draw | None = None
        self.radio = RadioPort(context, row)  #: the robot's radio

    @property
    def draw(self) -> Draw:
        """The robot's random draws."""
        if self._draw is None:
            context = self._context
            self._draw = Draw(int(context.keys[self._row]), context.tick, context.first_draw)
        return self._draw

    def sensor(self, name: str) -> CustomReading:
        """Return the reading of a custom sensor: each field is an attribute, a float or an array (width,)."""
        columns = ((field, values[self._row]) for field, values in self._context.fields(name).items())
        return CustomReading(name, {field: value if np.ndim(value) else float(value) for field, value in columns})

    def drive(self, linear_mps: float, angular_radps: float, lateral_mps: float = 0.0) -> None:
        """Command forward speed and turn rate (positive to the left); they apply until the next call.

        A body with a holonomic drive can also move sideways, positive to the left. Speeds above the body's limits are
        clipped. A command with nan is ignored and the last one still applies (`clipped_commands` and `nan_commands` in
        the summary).
        """
        self._context.command(self._row, linear_mps, angular_radps, lateral_mps)

    def wheels(self, left_mps: float, right_mps: float) -> None:
        """Command the speeds of two wheels; they apply until the next command. IncompatibleBody without wheels."""
        self.drive(*twist_of_wheels(left_mps, right_mps, self.body.wheels.wheel_base_m))

    def led(self, red: float, green: float, blue: float, index: int | None = None) -> None:
        """Set the colour of all LEDs, or of LED `index` of the body's spec, each share 0 to 1; all 0: dark.

        The colour lasts until the next call. IncompatibleBody if the body has no LEDs, ValueError if it lacks this one.
        """
        self._context.led_one(self._row, index, rgb_of_one(red, green, blue))

    def actuate(self, name: str, values: ArrayLike) -> None:
        """Set a custom actuator to one number or to (width,); it defines their effect and its duration.

        IncompatibleBody if the body has none of this name, ValueError for a wrong shape or if one is not finite.
        """
        self._context.actuate(name, np.reshape(values, (1, -1)), slice(self._row, self._row + 1))

    def note(self, state: str | None = None, *, value: float | None = None) -> None:
        """Note the robot's state ("search", "wait") and a number, such as its estimate, for observers of the run.

        States are for recordings and pictures, numbers for recordings and metrics (`consensus_error`); each is valid
        until the next note. ValueError if both are None, for a state that is no short text, for a number that is not
        finite.
        """
        self._context.note_one(self._row, state, None if value is None else float(value))

    def _reading(self, sensor: SensorProperty[Any, Any]) -> Any:
        values = self._context.reading(sensor, self._row)
        return (
            sensor.make_reading(*values, self.body.sensors[sensor.name])
            if sensor.has_spec
            else sensor.make_reading(*values)
        )


class RadioPort:
    """The robot's radio: an unreliable medium."""

    def __init__(self, context: StepContext, row: int) -> None:
        self._context, self._row = context, row

    @overload
    def received(self, kind: type[M]) -> "list[Packet[M]]": ...
    @overload
    def received(self, kind: type[dict[str, Any]]) -> "list[Packet[dict[str, Any]]]": ...
    def received(self, kind: type[Any]) -> "list[Packet[Any]]":
        """Return the packets of a message class (or `dict`) received since the robot's last step, by time.

        A payload with this tag that does not decode, as runners of other code may send, is left out.
        """
        lists = self._context.received_lists
        if kind is not dict:
            payloads = lists.payloads(self._row, message_class(kind).tag, kind.size_bytes)
            return [Packet(lists, index, kind.decode_at(data, start)) for index, data, start, _ in payloads]
        payloads = lists.payloads(self._row, DICT_TAG)
        decoded = ((index, dict_in(data[start:end])) for index, data, start, end in payloads)
        return [Packet(lists, index, message) for index, message in decoded if message is not None]

    def send(self, message: Message | dict[str, Any], to: int | None = None) -> int:
        """Broadcast a message, or send it to the robot with index `to` in the arena; return the packet's id."""
        return self._context.send_one(self._row, to, _encoded(message))

    @property
    def tx_status(self) -> list[TxStatus]:
        """Results of unicast packets since the robot's last step, by id."""
        statuses = self._context.tx_statuses_of(self._row)
        return [TxStatus(id_, TxResult(result)) for id_, result in statuses]


def _encoded(message: object) -> bytes:
    if isinstance(message, Message):
        return message.encode()
    if isinstance(message, dict):
        return encode_dict(cast("dict[str, Any]", message))
    raise TypeError(f"send(message): expected a message or a dict, got {message!r}")
