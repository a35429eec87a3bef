"""Observations and actions of a policy as rows of numbers, read and set through the handles of robots.

A `PolicyIO` holds the choice (sensors, neighbours, message, speeds); a `PolicyLayout` is that choice for one body: the
name, lowest and highest value of each number, `observe` and `act`. Training and robots share this code, so a robot runs
the policy that was trained. This module needs numpy only.
"""

from dataclasses import dataclass
from functools import cache, cached_property
from math import inf, isfinite
from typing import Annotated, Any, Literal, TypeVar, cast

import numpy as np

from swarmwire.agent import portable
from swarmwire.agent.packet import Packets
from swarmwire.agent.robots import Robots
from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.robot.bodies.body import Body
from swarmwire.comms.robot.bodies.drives import Holonomic, Twist
from swarmwire.comms.robot.messages import Message
from swarmwire.comms.robot.sensors.camera import WHITE
from swarmwire.comms.robot.sensors.sensor import Field

Float32Array = np.ndarray[Any, np.dtype[np.float32]]
A = TypeVar("A", bound=np.ndarray[Any, Any])
MEASURED: dict[str, list[tuple[str, float, float]]] = {  # name, lowest and highest value of each number of a packet
    "radio.range": [("range_m", 0.0, inf)],
    "radio.bearing": [("sin bearing", -1.0, 1.0), ("cos bearing", -1.0, 1.0)],
    "radio.rssi": [("rssi", -inf, inf)],
}
HEADING = "compass.heading_rad"  # a shared heading arrives relative to the receiver's
MAX_NUMBERS = 64  # in a message; also the limit of neighbours
TINY = 1e-300
EMPTY_SLOT = -1  # packet index of a neighbour slot without a neighbour
MAX_PAIRS = 2**22  # rows of a table with one per receiver and sender
RSSI_OFFSET_DBM, RSSI_SCALE_DBM = 100.0, 100.0  # -100 dBm reads 0, 0 dBm reads 1


@dataclass(frozen=True, kw_only=True)
class PolicyIO:
    """The inputs and outputs of a policy, apart from the body.

    A robot broadcasts in each step if `message` or `shared` asks for it, and sees the newest message of each of at most
    `neighbours` senders that it received since its last step.
    """

    sensors: tuple[str, ...] = ()  #: names of the body's sensors, in this order
    measures: tuple[str, ...] = ()  #: measurements of packets: radio.range, radio.bearing, radio.rssi
    neighbours: int = 0  #: maximum number of neighbours whose messages it sees
    order: Literal["nearest", "newest"] = "newest"  #: neighbours that come first; further ones are ignored
    message: int = 0  #: numbers from -1 to 1 that the policy sends
    shared: tuple[str, ...] = ()  #: names from `sensors`: their numbers are sent with each message
    speed_mps: float | None = None  #: speed at the action 1; None: the body's limit
    turn_radps: float | None = None

    def __post_init__(self) -> None:
        for name in ("neighbours", "message"):
            if not 0 <= getattr(self, name) <= MAX_NUMBERS:
                raise BadInput("policy", name, f"expected 0 to {MAX_NUMBERS}, got {getattr(self, name)!r}")
        for name in ("speed_mps", "turn_radps"):
            if getattr(self, name) is not None and not 0.0 < getattr(self, name) < inf:
                raise BadInput("policy", name, f"expected a number above 0, got {getattr(self, name)!r}")
        if unknown := set(self.measures) - set(MEASURED):
            raise BadInput("policy", "measures", f"expected some of {', '.join(MEASURED)}, got {min(unknown)!r}")
        if missing := set(self.shared) - set(self.sensors):
            raise BadInput("policy", "shared", f"expected some of sensors, got {min(missing)!r}")
        if self.order == "nearest" and self.neighbours and "radio.range" not in self.measures:
            raise BadInput("policy", "order", 'expected "newest", or radio.range among the measures')

    @property
    def needs(self) -> tuple[str, ...]:
        """The `needs` of an agent with these inputs."""
        return (*self.sensors, *self.measures)

    @property
    def sends(self) -> bool:
        """True if each robot broadcasts in each step."""
        return bool(self.message or self.shared)


Number = tuple[str, float, float]  # name, lowest and highest value


@dataclass(frozen=True, eq=False)  # hashed by identity
class _Column:
    """A field of a sensor, as numbers of an observation."""

    sensor: str
    field: Field

    @property
    def key(self) -> str:
        return f"{self.sensor}.{self.field.name}"

    @cached_property
    def numbers(self) -> list[Number]:
        """Sine and cosine of an angle; a bounded number scaled to 0 to 1; any other number in its unit."""
        field, key = self.field, self.key
        names = [f"{key}[{k}]" for k in range(field.width)] if field.width else [key]
        if field.angle:
            return [(f"{side} {name}", -1.0, 1.0) for name in names for side in ("sin", "cos")]
        low, high = (0.0, 1.0) if self._is_bounded else (min(field.low, 0.0), max(field.high, 0.0))
        return [(name, low, high) for name in names]

    @cached_property
    def _bounds(self) -> tuple[float, float]:
        return (0.0, float(WHITE)) if self.key == "camera.colour" else (self.field.low, self.field.high)

    @property
    def _is_bounded(self) -> bool:
        return isfinite(self._bounds[0]) and isfinite(self._bounds[1])

    def read(self, robots: Robots) -> FloatArray | Float32Array:
        """Return the numbers of each robot, (n, numbers); not finite where a reading was lost."""
        values: FloatArray = getattr(robots.sensor(self.sensor), self.field.name)
        if values.ndim == 1:
            values = values[:, None]
        if self.field.angle:
            numbers: Float32Array = np.empty((len(values), 2 * values.shape[1]), np.float32)
            numbers[:, ::2], numbers[:, 1::2] = _sine_and_cosine(values)
            return numbers
        if self._is_bounded:
            low, high = self._bounds
            return _clipped((values - low) / (high - low), 0.0, 1.0)
        return values


ColumnValues = dict[_Column, FloatArray | Float32Array]  # numbers of each column, (n, numbers)


@cache
def policy_message(numbers: int) -> type[Message]:
    """Make the class of messages with these numbers, `v0`, `v1` …, each float32 on air."""
    fields = {f"v{k}": Annotated[float, np.dtype("<f4")] for k in range(numbers)}
    return type(f"Policy{numbers}", (Message,), {"__annotations__": fields, "__module__": __name__})


class PolicyLayout:
    """A `PolicyIO` for robots of one body.

    An observation is: the numbers of each sensor; then for each neighbour slot 1 (in an empty slot all numbers are 0),
    those of its range in m, sine and cosine of its bearing, and RSSI as (dBm + 100) / 100 that `measures` names, the
    numbers that it sent, and those that it shared. A shared compass heading arrives relative to the receiver's.

    An action is: forward speed and turn rate (of a holonomic drive: forward, to the left, turn) as shares of the limits
    from -1 to 1, then the numbers to send. Speeds that a drive cannot have together are scaled down together.
    """

    io: PolicyIO  #: the choice of numbers
    body: Body  #: the robots' body
    observation: tuple[str, ...]  #: the name of each number of an observation
    low: Float32Array  #: the lowest value of each number of an observation
    high: Float32Array  #: the highest value of each number of an observation
    action: tuple[str, ...]  #: the name of each number of an action, from -1 to 1

    def __init__(self, io: PolicyIO, body: Body) -> None:
        """Build the layout; BadInput if the body lacks a sensor."""
        self.io, self.body = io, body
        for sensor in io.sensors:
            if sensor not in body.sensors:
                names = ", ".join(body.sensors) or "none"
                raise BadInput("policy", "sensors", f"the body {body.name} has no {sensor!r}: it has {names}")
        self._columns = [_Column(name, field) for name in io.sensors for field in body.sensors[name].reading_fields()]
        self._shared = [column for column in self._columns if column.sensor in io.shared]
        slot = [("present", 0.0, 1.0), *(number for measure in io.measures for number in MEASURED[measure])]
        slot += [(f"v{k}", -1.0, 1.0) for k in range(io.message)]
        slot += [number for column in self._shared for number in column.numbers]
        numbers = [number for column in self._columns for number in column.numbers]
        numbers += [(f"neighbour {k} {name}", low, high) for k in range(io.neighbours) for name, low, high in slot]
        self.observation = tuple(name for name, _, _ in numbers)
        self.low = np.array([low for _, low, _ in numbers], np.float32)
        self.high = np.array([high for _, _, high in numbers], np.float32)
        self._holonomic = isinstance(body.drive, Holonomic)
        drive = ("forward", "left", "turn") if self._holonomic else ("forward", "turn")
        self.action = (*drive, *(f"v{k}" for k in range(io.message)))
        self._drive_count, self._slot_width = len(drive), len(slot)
        self._kind = policy_message(io.message + sum(len(column.numbers) for column in self._shared))
        self._speed_mps = min(io.speed_mps or inf, body.max_linear_mps)
        self._turn_radps = min(io.turn_radps or inf, body.max_angular_radps)

    def __reduce__(self) -> tuple[Any, ...]:
        """Build a copy from its arguments: the class of its messages cannot be pickled."""
        return PolicyLayout, (self.io, self.body)

    def observe(self, robots: Robots) -> Float32Array:
        """Return the observation of each robot in this tick, (n, numbers), finite."""
        observation = np.empty((robots.n, len(self.observation)), np.float32)
        values, start = {column: column.read(robots) for column in self._columns}, 0
        for numbers in values.values():
            end = start + numbers.shape[1]
            observation[:, start:end] = numbers
            start = end
        if self.io.neighbours:
            observation[:, start:] = self._neighbours(robots, values)
        return _finite(observation)

    def act(self, robots: Robots, action: FloatArray | Float32Array) -> None:
        """Drive and send by an action of each robot, (n, numbers); numbers beyond -1 to 1 are clipped."""
        action = _clipped(action.astype(np.float64), -1.0, 1.0)
        linear, angular = action[:, 0] * self._speed_mps, action[:, self._drive_count - 1] * self._turn_radps
        drive = self.body.drive
        if isinstance(drive, Holonomic):
            lateral = action[:, 1] * self._speed_mps
            scale = _scale(portable.hypot(linear, lateral), drive.max_linear_mps)
            robots.drive(linear * scale, angular, lateral * scale)
        elif isinstance(drive, Twist):  # its two limits are independent
            robots.drive(linear, angular)
        else:
            scale = _scale(np.abs(linear) + 0.5 * drive.wheel_base_m * np.abs(angular), drive.max_linear_mps)
            robots.drive(linear * scale, angular * scale)
        if self.io.sends:
            sent = [action[:, self._drive_count :], *(_finite(column.read(robots)) for column in self._shared)]
            numbers = np.concatenate(sent, axis=1)
            fields: dict[str, Any] = {f"v{k}": numbers[:, k] for k in range(numbers.shape[1])}
            robots.radio.send(self._kind, **fields)

    def _neighbours(self, robots: Robots, values: ColumnValues) -> Float32Array:
        """Return the numbers of the neighbours, (n, neighbours x numbers)."""
        received, io = robots.radio.received(self._kind), self.io
        block = np.zeros((robots.n * io.neighbours, self._slot_width), np.float32)
        if len(received):
            index = _newest_packets(received, robots.n, io.neighbours, by_range=io.order == "nearest")
            filled = np.flatnonzero(index != EMPTY_SLOT)
            table = self._slots(values, received, index[filled], filled // io.neighbours)
            if len(filled) == len(block):
                block = table
            else:
                block[filled] = table
        return block.reshape(robots.n, -1)

    def _slots(self, values: ColumnValues, received: Packets[Message], index: IntArray, row: IntArray) -> Float32Array:
        """Return numbers of neighbour slots, (k, numbers), from packets `index` (k,) received by robots `row` (k,)."""
        columns: list[FloatArray | Float32Array] = [np.ones(1)]
        for measure in self.io.measures:
            columns += _measured(received, measure, index)
        columns += [getattr(received.message, name)[index] for name in self._kind.ranges]
        start = self._slot_width - sum(len(column.numbers) for column in self._shared)
        for column in self._shared:
            if column.key == HEADING:
                receiver_sine, receiver_cosine = values[column][row].T
                sine, cosine = columns[start], columns[start + 1]
                columns[start] = sine * receiver_cosine - cosine * receiver_sine
                columns[start + 1] = cosine * receiver_cosine + sine * receiver_sine
            start += len(column.numbers)
        table = np.empty((len(index), self._slot_width), np.float32)
        for k, column in enumerate(columns):
            table[:, k] = column
        return table


def _clipped(values: FloatArray, low: float, high: float) -> FloatArray:
    """Clip to these bounds; faster than `np.clip` for few robots."""
    return np.minimum(np.maximum(values, low), high)


def _finite(values: A) -> A:
    """Return the values with 0 for those that are not finite, from readings that were lost."""
    finite = np.isfinite(values)
    return values if finite.all() else cast("A", np.where(finite, values, values.dtype.type(0.0)))


def _scale(fastest_mps: FloatArray, limit_mps: float) -> FloatArray:
    """Return the factor from 0 to 1 for speeds, with which the fastest keeps the limit."""
    return np.minimum(limit_mps / np.maximum(fastest_mps, TINY), 1.0)


def _sine_and_cosine(angle: FloatArray) -> tuple[FloatArray, FloatArray]:
    return portable.sin(angle), portable.cos(angle)


def _measured(received: Packets[Message], measure: str, index: IntArray) -> list[FloatArray | Float32Array]:
    """Return the numbers of a measurement of packets `index` (k,), each (k,)."""
    if measure == "radio.range":
        return [received.range_m[index]]
    if measure == "radio.bearing":
        return [*_sine_and_cosine(received.bearing_rad[index])]
    return [(received.rssi_dbm[index] + RSSI_OFFSET_DBM) / RSSI_SCALE_DBM]


def _newest_packets(received: Packets[Any], n: int, max_packets: int, *, by_range: bool) -> IntArray:
    """Return the indices in `received` of the newest packet of each sender, for each of n robots, (n x max_packets,).

    A robot's packets are in order, the newest first, or with `by_range` the nearest first; then follows EMPTY_SLOT.
    """
    index = _newest_of_each(received.row, received.sender, n)
    row = received.row[index]
    count = np.bincount(row, minlength=n)
    first = np.cumsum(count) - count
    slots = np.arange(max_packets)
    if by_range:
        width = max(int(count.max()), max_packets)
        ranges: FloatArray = np.full(n * width, inf)
        ranges[np.arange(len(row)) + (np.arange(n) * width - first)[row]] = received.range_m[index]
        position: IntArray = np.argsort(ranges.reshape(n, width), axis=1, kind="stable")[:, :max_packets]
    else:
        position = count[:, None] - 1 - slots
    is_filled = slots < count[:, None]
    return np.where(is_filled, index[np.where(is_filled, first[:, None] + position, 0)], EMPTY_SLOT).reshape(-1)


def _newest_of_each(row: IntArray, sender: IntArray, n: int) -> IntArray:
    """Return the index of the last packet of each robot and sender, rising; packets are ordered by robot, then time."""
    senders = int(sender.max()) + 1
    pair = row * senders + sender
    if n * senders > MAX_PAIRS:
        pair = np.unique(pair, return_inverse=True)[1].reshape(-1)
    last = np.zeros(min(n * senders, int(pair.max()) + 1), np.int64)
    index = np.arange(len(pair))
    last[pair] = index  # numpy keeps the last of several values
    return np.flatnonzero(last[pair] == index)
