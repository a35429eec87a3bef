"""What a policy sees and sets: observations and actions as rows of numbers, by way of the handles of robots.

A `PolicyIO` holds the choice (sensors, neighbours, message, speeds); a `PolicyLayout` is that choice for one body: the
name, lowest and highest value of each number, `observe` and `act`. Training and robots share this code, so what was
trained is what is deployed. Numpy only.
"""

from dataclasses import dataclass
from functools import cache, cached_property
from math import inf, isfinite
from typing import Annotated, Any, Literal, TypeVar, cast

import numpy as np

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
MEASURED: dict[str, list[tuple[str, float, float]]] = {  # of a packet: each number's name, lowest and highest value
    "radio.range": [("range_m", 0.0, inf)],
    "radio.bearing": [("sin bearing", -1.0, 1.0), ("cos bearing", -1.0, 1.0)],
    "radio.rssi": [("rssi", -inf, inf)],
}
HEADING = "compass.heading_rad"  # shared, it arrives relative to the receiver's own
MAX_NUMBERS = 64  # of a message, or of neighbours
TINY = 1e-300
NO_PACKET = -1  # in an empty slot of a neighbour
MAX_PAIRS = 2**22  # of receiver and sender in a table
RSSI_OFFSET_DBM, RSSI_SCALE_DBM = 100.0, 100.0  # -100 dBm reads 0, 0 dBm reads 1


@dataclass(frozen=True, kw_only=True)
class PolicyIO:
    """What a policy sees and sets, apart from the body.

    A robot broadcasts in each step if `message` or `shared` asks for it, and sees the newest message of each of at most
    `neighbours` senders that it received since its last step.
    """

    sensors: tuple[str, ...] = ()  # of the body, in this order
    measures: tuple[str, ...] = ()  # of a packet: radio.range, radio.bearing, radio.rssi
    neighbours: int = 0  # whose messages it sees; 0: none
    order: Literal["nearest", "newest"] = "newest"  # which of them first, and which if there are more
    message: int = 0  # numbers from -1 to 1 that the policy sends
    shared: tuple[str, ...] = ()  # of `sensors`: their numbers are sent with each message
    speed_mps: float | None = None  # of the action 1; None: the body's limit
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
        """The `needs` of an agent that observes so."""
        return (*self.sensors, *self.measures)

    @property
    def sends(self) -> bool:
        """Whether each robot broadcasts in each step."""
        return bool(self.message or self.shared)


Number = tuple[str, float, float]  # its name, lowest and highest value


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
        """Sine and cosine of an angle; a number that is bounded as 0 to 1; any other in its unit."""
        of, key = self.field, self.key
        names = [f"{key}[{k}]" for k in range(of.width)] if of.width else [key]
        if of.angle:
            return [(f"{side} {name}", -1.0, 1.0) for name in names for side in ("sin", "cos")]
        return [(name, *((0.0, 1.0) if self._bounded else (min(of.low, 0.0), max(of.high, 0.0)))) for name in names]

    @cached_property
    def _ends(self) -> tuple[float, float]:
        return (0.0, float(WHITE)) if self.key == "camera.colour" else (self.field.low, self.field.high)

    @property
    def _bounded(self) -> bool:
        return isfinite(self._ends[0]) and isfinite(self._ends[1])

    def read(self, robots: Robots) -> FloatArray | Float32Array:
        """Its numbers of each robot, (n, numbers); not finite where a reading was lost."""
        values: FloatArray = getattr(robots.sensor(self.sensor), self.field.name)
        if values.ndim == 1:
            values = values[:, None]
        if self.field.angle:
            sides: Float32Array = np.empty((len(values), 2 * values.shape[1]), np.float32)
            sides[:, ::2], sides[:, 1::2] = _sides(values)
            return sides
        if self._bounded:
            low, high = self._ends
            return _within((values - low) / (high - low), 0.0, 1.0)
        return values


Own = dict[_Column, FloatArray | Float32Array]  # a robot's own numbers of each column


@cache
def policy_message(numbers: int) -> type[Message]:
    """The class of messages of so many numbers, `v0`, `v1` …, each float32 on air."""
    fields = {f"v{k}": Annotated[float, np.dtype("<f4")] for k in range(numbers)}
    return type(f"Policy{numbers}", (Message,), {"__annotations__": fields, "__module__": __name__})


class PolicyLayout:
    """A `PolicyIO` for robots of one body.

    An observation is: the numbers of each sensor; then for each neighbour 1 (0: there is no such neighbour, and all its
    numbers are 0), its range in m, sine and cosine of its bearing, its RSSI as (dBm + 100) / 100, as far as `measures`
    names them, the numbers that it sent, and those that it shared. A shared heading of the compass arrives relative to
    the receiver's own.

    An action is: forward speed and turn rate (of a holonomic drive: forward, to the left, turn) as shares of the limits
    from -1 to 1, then the numbers to send. Speeds that a drive cannot have together are scaled down together.

    Attributes:
        io: the choice.
        body: of the robots.
        observation: the name of each number of an observation.
        low: the lowest value of each.
        high: the highest value of each.
        action: the name of each number of an action; all are from -1 to 1.
    """

    def __init__(self, io: PolicyIO, body: Body) -> None:
        """BadInput if the body lacks a sensor."""
        self.io, self.body = io, body
        for sensor in io.sensors:
            if sensor not in body.sensors:
                has = ", ".join(body.sensors) or "none"
                raise BadInput("policy", "sensors", f"the body {body.name} has no {sensor!r}: it has {has}")
        self._columns = [_Column(name, of) for name in io.sensors for of in body.sensors[name].reading_fields()]
        self._shared = [column for column in self._columns if column.sensor in io.shared]
        slot = [("present", 0.0, 1.0), *(number for measure in io.measures for number in MEASURED[measure])]
        slot += [(f"v{k}", -1.0, 1.0) for k in range(io.message)]
        slot += [number for column in self._shared for number in column.numbers]
        numbers = [number for column in self._columns for number in column.numbers]
        numbers += [(f"neighbour {k} {name}", low, high) for k in range(io.neighbours) for name, low, high in slot]
        self.observation = tuple(name for name, _, _ in numbers)
        self.low: Float32Array = np.array([low for _, low, _ in numbers], np.float32)
        self.high: Float32Array = np.array([high for _, _, high in numbers], np.float32)
        self._holonomic = isinstance(body.drive, Holonomic)
        drive = ("forward", "left", "turn") if self._holonomic else ("forward", "turn")
        self.action = (*drive, *(f"v{k}" for k in range(io.message)))
        self._drives, self._slot = len(drive), len(slot)
        self._kind = policy_message(io.message + sum(len(column.numbers) for column in self._shared))
        self._speed_mps = min(io.speed_mps or inf, body.max_linear_mps)
        self._turn_radps = min(io.turn_radps or inf, body.max_angular_radps)

    def __reduce__(self) -> tuple[Any, ...]:
        """A copy is made anew: the class of its messages cannot be pickled."""
        return PolicyLayout, (self.io, self.body)

    def observe(self, robots: Robots) -> Float32Array:
        """The observation of each robot in this tick, (n, numbers), finite."""
        values = np.empty((robots.n, len(self.observation)), np.float32)
        own, at = {column: column.read(robots) for column in self._columns}, 0
        for numbers in own.values():
            end = at + numbers.shape[1]
            values[:, at:end] = numbers
            at = end
        if self.io.neighbours:
            values[:, at:] = self._neighbours(robots, own)
        return _finite(values)

    def act(self, robots: Robots, action: FloatArray | Float32Array) -> None:
        """Drive and send as an action of each robot says, (n, numbers); numbers beyond -1 to 1 are clipped."""
        action = _within(action.astype(np.float64), -1.0, 1.0)
        linear, angular = action[:, 0] * self._speed_mps, action[:, self._drives - 1] * self._turn_radps
        drive = self.body.drive
        if isinstance(drive, Holonomic):
            lateral = action[:, 1] * self._speed_mps
            scale = _scale(np.hypot(linear, lateral), drive.max_linear_mps)
            robots.drive(linear * scale, angular, lateral * scale)
        elif isinstance(drive, Twist):  # its two limits are apart
            robots.drive(linear, angular)
        else:
            scale = _scale(np.abs(linear) + 0.5 * drive.wheel_base_m * np.abs(angular), drive.max_linear_mps)
            robots.drive(linear * scale, angular * scale)
        if self.io.sends:
            sent = [action[:, self._drives :], *(_finite(column.read(robots)) for column in self._shared)]
            numbers = np.concatenate(sent, axis=1)
            fields: dict[str, Any] = {f"v{k}": numbers[:, k] for k in range(numbers.shape[1])}
            robots.radio.send(self._kind, **fields)

    def _neighbours(self, robots: Robots, own: Own) -> Float32Array:
        """The part of the observations that is of neighbours, (n, neighbours x numbers)."""
        received, io = robots.radio.received(self._kind), self.io
        block = np.zeros((robots.n * io.neighbours, self._slot), np.float32)
        if len(received):
            index = _newest_packets(received, robots.n, io.neighbours, by_range=io.order == "nearest")
            there = np.flatnonzero(index != NO_PACKET)
            table = self._slots(own, received, index[there], there // io.neighbours)
            if len(there) == len(block):
                block = table
            else:
                block[there] = table
        return block.reshape(robots.n, -1)

    def _slots(self, own: Own, received: Packets[Message], index: IntArray, row: IntArray) -> Float32Array:
        """The numbers of neighbours: of packets `index` (k,), which robots `row` (k,) received; (k, numbers)."""
        columns: list[FloatArray | Float32Array] = [np.ones(1)]
        for measure in self.io.measures:
            columns += _measured(received, measure, index)
        columns += [getattr(received.message, name)[index] for name in self._kind.ranges]
        at = self._slot - sum(len(column.numbers) for column in self._shared)
        for column in self._shared:
            if column.key == HEADING:
                own_sine, own_cosine = own[column][row].T
                sine, cosine = columns[at], columns[at + 1]
                columns[at] = sine * own_cosine - cosine * own_sine
                columns[at + 1] = cosine * own_cosine + sine * own_sine
            at += len(column.numbers)
        table = np.empty((len(index), self._slot), np.float32)
        for k, column in enumerate(columns):
            table[:, k] = column
        return table


def _within(values: FloatArray, low: float, high: float) -> FloatArray:
    """Clipped to these ends; faster than `np.clip` for few robots."""
    return np.minimum(np.maximum(values, low), high)


def _finite(values: A) -> A:
    """These, or a copy with 0 in place of what is not finite: of readings that were lost."""
    finite = np.isfinite(values)
    return values if finite.all() else cast("A", np.where(finite, values, values.dtype.type(0.0)))


def _scale(fastest_mps: FloatArray, limit_mps: float) -> FloatArray:
    """By how much speeds must shrink so that the fastest keeps the limit, 0 to 1."""
    return np.minimum(limit_mps / np.maximum(fastest_mps, TINY), 1.0)


def _sides(angle: FloatArray) -> tuple[Float32Array, Float32Array]:
    """Sine and cosine, in the precision of observations, which takes a quarter of the time."""
    narrow = angle.astype(np.float32)
    return np.sin(narrow), np.cos(narrow)


def _measured(received: Packets[Message], measure: str, index: IntArray) -> list[FloatArray | Float32Array]:
    """The numbers of a measurement of packets `index` (k,), each (k,)."""
    if measure == "radio.range":
        return [received.range_m[index]]
    if measure == "radio.bearing":
        return [*_sides(received.bearing_rad[index])]
    return [(received.rssi_dbm[index] + RSSI_OFFSET_DBM) / RSSI_SCALE_DBM]


def _newest_packets(received: Packets[Any], n: int, most: int, *, by_range: bool) -> IntArray:
    """The packets, by their place in `received`, of each of n robots: the newest of each sender, (n x most,).

    Those of a robot stand in order, the newest first, or with `by_range` the nearest; the rest is NO_PACKET.
    """
    index = _newest_of_each(received.row, received.sender, n)
    row = received.row[index]
    count = np.bincount(row, minlength=n)
    first = np.cumsum(count) - count
    slots = np.arange(most)
    if by_range:
        width = max(int(count.max()), most)
        ranges: FloatArray = np.full(n * width, inf)
        ranges[np.arange(len(row)) + (np.arange(n) * width - first)[row]] = received.range_m[index]
        place: IntArray = np.argsort(ranges.reshape(n, width), axis=1, kind="stable")[:, :most]
    else:
        place = count[:, None] - 1 - slots
    there = slots < count[:, None]
    return np.where(there, index[np.where(there, first[:, None] + place, 0)], NO_PACKET).reshape(-1)


def _newest_of_each(row: IntArray, sender: IntArray, n: int) -> IntArray:
    """The last packet of each robot and sender, rising; packets are in order of robots, then of time."""
    senders = int(sender.max()) + 1
    pair = row * senders + sender
    if n * senders > MAX_PAIRS:
        pair = np.unique(pair, return_inverse=True)[1].reshape(-1)
    last = np.zeros(min(n * senders, int(pair.max()) + 1), np.int64)
    at = np.arange(len(pair))
    last[pair] = at  # of several, numpy keeps the last
    return np.flatnonzero(last[pair] == at)
