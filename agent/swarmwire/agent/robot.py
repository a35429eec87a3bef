"""Robot: the handle through which an Agent's step sees and moves its one robot."""

from typing import Any, TypeVar, cast, overload

import numpy as np
from numpy.typing import ArrayLike

from swarmwire.agent.packet import Packet, TxStatus
from swarmwire.agent.readings import BumperReading, CameraReading, CustomReading
from swarmwire.agent.robots import Draw, forward_and_turn
from swarmwire.agent.sensors import Sensors
from swarmwire.agent.step_context import StepContext
from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.bodies.drives import rgb_of
from swarmwire.comms.messages import DICT_TAG, Message, dict_in, encode_dict, message_class
from swarmwire.comms.packets import TxResult

M = TypeVar("M", bound=Message)


class Robot(Sensors[float]):
    """One robot in one tick. Senses raise NotDeclared unless the agent's `needs` name them."""

    __slots__ = ("_draw", "_row", "radio")

    def __init__(self, turn: StepContext, row: int) -> None:
        super().__init__(turn)
        self._row = row
        self._draw: Draw | None = None
        self.radio = RadioPort(turn, row)

    @property
    def draw(self) -> Draw:
        """Random draws of the robot's own."""
        if self._draw is None:
            self._draw = Draw(self._turn.keys[self._row : self._row + 1], self._turn.tick, self._turn.first_draw)
        return self._draw

    @property
    def bumper(self) -> BumperReading:
        """Whether the body touched anything."""
        return BumperReading(bool(self._number("bumper", "pressed")))

    @property
    def camera(self) -> CameraReading:
        """LEDs of other robots in sight."""
        return CameraReading.of(*(self._numbers("camera", name) for name in ("distance_m", "bearing_rad", "colour")))

    def sensor(self, name: str) -> CustomReading:
        """What a sense of your own reads: each field as an attribute, a float or an array (width,)."""
        columns = ((field, values[self._row]) for field, values in self._turn.fields(name).items())
        return CustomReading(name, {field: value if np.ndim(value) else float(value) for field, value in columns})

    def drive(self, linear_mps: float, angular_radps: float, lateral_mps: float = 0.0) -> None:
        """Wanted forward speed and turn rate (positive to the left); they hold until the next call.

        A body with a holonomic drive can also move sideways, positive to the left. What the body cannot do is clipped,
        and nan is no command: the last one holds (`clipped_commands` and `nan_commands` in the summary).
        """
        self._turn.drive[self._row] = True
        self._turn.linear_mps[self._row] = linear_mps
        self._turn.angular_radps[self._row] = angular_radps
        self._turn.lateral_mps[self._row] = lateral_mps

    def wheels(self, left_mps: float, right_mps: float) -> None:
        """Wanted speeds of the two wheels, until the next call of this or `drive`; NotFitted if the body has none."""
        self.drive(*forward_and_turn(left_mps, right_mps, self.body.wheels.wheel_base_m))

    def led(self, red: float, green: float, blue: float, which: int | None = None) -> None:
        """Colour of all LEDs, or of the one at place `which` of the body's sheet, each share 0 to 1; all 0: dark.

        It holds until the next call. NotFitted if the body has no LEDs, ValueError if it has not that one.
        """
        self._turn.leds(which)[self._row] = rgb_of(red, green, blue)

    def actuate(self, name: str, values: ArrayLike) -> None:
        """Set an actuator of your own, to one number or as many as it takes; what that does, and how long, it knows.

        NotFitted if the body has none of this name, ValueError if the numbers do not fit or are not finite.
        """
        self._turn.actuate(name, np.reshape(values, (1, -1)), slice(self._row, self._row + 1))

    def note(self, state: str | None = None, *, value: float | None = None) -> None:
        """Name what the robot is at ("search", "wait"), and tell a number, such as its estimate: for whoever looks on.

        States are for recordings and pictures, numbers for recordings and metrics (`consensus_error`); each holds until
        the next is given. ValueError if neither is, for a state that is no short text, for a number that is not finite.
        """
        self._turn.note(slice(self._row, self._row + 1), state, None if value is None else float(value))

    def _number(self, sensor: str, field: str) -> float:
        return self._turn.field(sensor, field).item(self._row)

    def _numbers(self, sensor: str, field: str) -> FloatArray:
        return self._turn.field(sensor, field)[self._row]


class RadioPort:
    """The robot's radio: an unreliable medium."""

    def __init__(self, turn: StepContext, row: int) -> None:
        self._turn, self._row = turn, row

    @overload
    def received(self, kind: type[M]) -> "list[Packet[M]]": ...
    @overload
    def received(self, kind: type[dict[str, Any]]) -> "list[Packet[dict[str, Any]]]": ...
    def received(self, kind: type[Any]) -> "list[Packet[Any]]":
        """The packets of a message class (or `dict`) received since the robot's last step, by time.

        What bears the tag and is none, as a runner of others may send it, is left out.
        """
        lists = self._turn.received_lists
        if kind is not dict:
            mine = lists.payloads(self._row, message_class(kind).tag, kind.size_bytes)
            return [Packet(lists, at, kind.decode_at(data, start)) for at, data, start, _ in mine]
        mine = lists.payloads(self._row, DICT_TAG)
        found = ((at, dict_in(data[start:end])) for at, data, start, end in mine)
        return [Packet(lists, at, message) for at, message in found if message is not None]

    def send(self, message: Message | dict[str, Any], to: int | None = None) -> int:
        """Send to all who hear it, or to the robot with index `to` in the arena; returns the packet's id."""
        return self._turn.send_one(self._row, to, _encoded(message))

    @property
    def tx_status(self) -> list[TxStatus]:
        """Packets sent to one robot that the radio is done with since the robot's last step, by id."""
        table = self._turn.tx_status()
        ids, results = table.id.tolist(), table.result.tolist()
        return [TxStatus(ids[at], TxResult(results[at])) for at in self._span(table.row)]

    def _span(self, row: IntArray) -> range:
        if not len(row):
            return range(0)
        return range(int(row.searchsorted(self._row)), int(row.searchsorted(self._row + 1)))


def _encoded(message: object) -> bytes:
    if isinstance(message, Message):
        return message.encode()
    if isinstance(message, dict):
        return encode_dict(cast("dict[str, Any]", message))
    raise TypeError(f"send(message): expected a message or a dict, got {message!r}")
