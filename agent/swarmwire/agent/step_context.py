"""One tick of one group: the readings and packets of its robots, and the actions that they build up.

Both handles, `Robot` and `Robots`, are views of a `StepContext`. `GroupContext` has the robots of a group as arrays;
`one_robot.RobotContext` has one robot without arrays. After the step, `end` or `end_receive` returns the actions, and
the context refuses any further use.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from swarmwire.agent.inbox import Inbox
from swarmwire.agent.packet import ListsOfTable, Packets, ReceivedLists, undeclared
from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray, KeyArray
from swarmwire.comms.base.sentinels import BROADCAST, NO_TX_STATUS
from swarmwire.comms.robot.bodies.body import IncompatibleBody
from swarmwire.comms.robot.messages import Message, decode_alike, decode_rows, message_class
from swarmwire.comms.robot.packets import Payloads, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.robot.sensors.sensor import SensorProperty
from swarmwire.comms.robot.tick_io import TABLES, Actions, GroupReadings, SparseTable, checked_state
from swarmwire.comms.wire.assignment import GroupAssignment

M = TypeVar("M", bound=Message)
TX_STATUS = "radio.tx_status"  # the need for tx statuses of addressed packets


class StepTime(NamedTuple):
    """The time of a step."""

    tick: int
    time_ns: int  # start of the tick; between steps the present time
    period_ns: int  # from the tick to the robots' next step


class DrawKeys(NamedTuple):
    """The keys of robots' random draws in one step."""

    keys: KeyArray  # (n,)
    first_draw: int = 0  # number of the first call for each purpose in this step


class StepContext(ABC):
    """Some robots of a group in one tick: the common part of the contexts of one robot and of many."""

    def __init__(self, group: GroupAssignment, needs: tuple[str, ...], time: StepTime, draw_keys: DrawKeys) -> None:
        self.group, self.needs = group, needs
        self.tick, self.time_ns, self.period_ns = time
        self.keys, self.first_draw = draw_keys
        self.n = len(self.keys)
        self._needs_tx_status = TX_STATUS in needs
        self._tables: dict[str, FloatArray] = {}  # values by name in TABLES, (n, slots); nan: not set in this tick

    @abstractmethod
    def reading(self, sensor: SensorProperty[Any, Any], index: int) -> list[Any]:
        """Return the fields of one robot's built-in sensor, each a float or (width,); NotDeclared as `fields`."""

    @abstractmethod
    def fields(self, sensor: str) -> Mapping[str, Any]:
        """Return all fields of a sensor by name, each with a value per robot: a float or (width,).

        NotDeclared if the agent's needs do not name the sensor.
        """

    @property
    @abstractmethod
    def received_lists(self) -> ReceivedLists:
        """Packets that these robots received, for agents of one robot each."""

    @abstractmethod
    def tx_statuses_of(self, index: int) -> list[tuple[int, int]]:
        """Return id and result of packets that one robot sent; NotDeclared if the agent's needs do not name them."""

    @abstractmethod
    def command(self, index: int, linear_mps: float, angular_radps: float, lateral_mps: float) -> None:
        """Command one robot's speeds; the last command of a tick counts."""

    @abstractmethod
    def send_one(self, index: int, to: int | None, payload: bytes) -> int:
        """Queue a packet of one robot; return its id."""

    @abstractmethod
    def note_one(self, index: int, state: str | None, value: float | None) -> None:
        """Note a state of one robot, and a number; the last note of a tick counts.

        ValueError as `check_note`, and for a number that is not finite.
        """

    @abstractmethod
    def led_one(self, index: int, led: int | None, rgb: int) -> None:
        """Set the colour of one LED of one robot, or of all; the last colour counts. Errors as `led_slots`."""

    def led_slots(self, led: int | None) -> slice:
        """Return one LED of the body, or all; IncompatibleBody if it has no LEDs, ValueError if it lacks this one."""
        body = self.group.body
        if not body.led_count:
            raise IncompatibleBody(f"the body {body.name} has no LEDs")
        if led is not None and not 0 <= led < body.led_count:
            raise ValueError(f"led(index=…): the body {body.name} has LEDs 0 to {body.led_count - 1}, got {led}")
        return slice(0, body.led_count) if led is None else slice(led, led + 1)

    def actuate(self, name: str, values: ArrayLike, rows: slice, mask: BoolArray | None = None) -> None:
        """Set a custom actuator of some robots to numbers (rows, width), or a shape that broadcasts to it.

        With a mask (rows,) only the robots of the mask are set, and the numbers of the others are ignored.
        IncompatibleBody if the body has none of this name, ValueError for a wrong shape or if one is not finite.
        """
        body = self.group.body
        if name not in body.actuators:
            names = ", ".join(body.actuators) or "none"
            raise IncompatibleBody(f"the body {body.name} has no custom actuator {name!r}: it has {names}")
        numbers, width = np.asarray(values, np.float64), body.actuators[name].width
        table = self._table("actuators", sum(spec.width for spec in body.actuators.values()))
        columns = table[rows, body.actuator_slices[name]]
        if numbers.ndim == 1 and width == 1:
            numbers = numbers[:, None]  # (n,): one number per robot
        fits = numbers.ndim < 2 or (numbers.ndim == 2 and len(numbers) == len(columns))
        if not fits or (numbers.ndim and numbers.shape[-1] != width):
            raise ValueError(f"actuate({name!r}, …): expected {width} numbers, got the shape {np.shape(values)}")
        selected = np.ones(len(columns), np.bool_) if mask is None else mask
        numbers = np.broadcast_to(numbers, columns.shape)[selected]
        if not np.isfinite(numbers).all():
            raise ValueError(f"actuate({name!r}, …): expected finite numbers, got {values!r}")
        columns[selected] = numbers

    if not TYPE_CHECKING:

        def __getattr__(self, name):
            raise RuntimeError("robot and radio are valid for one step: use the arguments of this step, keep none")

    def _table(self, name: str, slots: int) -> FloatArray:
        """Return the numbers that were set in this tick, (n, slots), to write into."""
        if name not in self._tables:
            self._tables[name] = np.full((self.n, slots), np.nan)
        return self._tables[name]

    def _require(self, need: str) -> None:
        if need not in self.needs:
            raise undeclared(need, self.needs)


def check_note(state: str | None, value: object) -> None:
    """Raise ValueError for a note without content, or with a state that is no short text."""
    if state is None and value is None:
        raise ValueError("note(…): expected a state, a value, or both")
    if state is not None:
        checked_state(state)


def receiver_of(to: int | None) -> int:
    """Return the number of the receiver in a frame; ValueError unless `to` is None or the index of a robot."""
    if to is None:
        return BROADCAST
    if to < 0 or int(to) != to:
        raise ValueError(f"send(to=…): expected the index of a robot in the arena, 0 or more, got {to}")
    return int(to)


class GroupContext(StepContext):
    """The robots `readings.rows` of a group in one tick, as arrays.

    In the inbox, `received.receiver` and `tx_status.row` are indices of these rows.
    """

    def __init__(
        self,
        group: GroupAssignment,
        needs: tuple[str, ...],
        time: StepTime,
        readings: GroupReadings,
        inbox: Inbox,
        draw_keys: DrawKeys,
        sent_counts: IntArray,
    ) -> None:
        """Begin; `sent_counts` (n,), the packets that each robot has sent so far, are incremented here."""
        super().__init__(group, needs, time, draw_keys)
        self.readings = readings
        self.received, self._tx_status = inbox
        self.tx_status_rows = self._tx_status.row  # indices of the robots with a status, (k,)
        self.drive = np.zeros(self.n, np.bool_)
        self.linear_mps, self.angular_radps, self.lateral_mps = np.zeros((3, self.n))
        self._sent_counts = sent_counts
        self._outbox: list[SentPackets] = []
        self._states: dict[str, int] = {}  # index of each state that was noted in this tick
        self._packets: dict[type[Message], Packets[Any]] = {}
        self._lists: ReceivedLists | None = None

    def columns(self, sensor: SensorProperty[Any, Any]) -> list[FloatArray]:
        """Return the fields of a built-in sensor, (n, …) each; NotDeclared if `needs` lacks it."""
        self._require(sensor.name)
        return [*map(self.readings.fields.__getitem__, sensor.columns)]

    def reading(self, sensor: SensorProperty[Any, Any], index: int) -> list[Any]:
        """Return the fields of one robot's built-in sensor, each a float or (width,); NotDeclared as `fields`."""
        return [column.item(index) if column.ndim == 1 else column[index] for column in self.columns(sensor)]

    def fields(self, sensor: str) -> dict[str, FloatArray]:
        """Return all fields of a sensor, (n, …) each, by name; NotDeclared if `needs` lacks it."""
        self._require(sensor)
        prefix, fields = f"{sensor}.", self.readings.fields
        return {name.removeprefix(prefix): values for name, values in fields.items() if name.startswith(prefix)}

    def tx_status(self) -> TxStatuses:
        """Return tx statuses of packets that these robots sent; NotDeclared if the agent's needs do not name them."""
        self._require(TX_STATUS)
        return self._tx_status

    def tx_statuses_of(self, index: int) -> list[tuple[int, int]]:
        """Return id and result of packets that one robot sent; NotDeclared if the agent's needs do not name them."""
        statuses = self.tx_status()
        span = slice(*statuses.row.searchsorted((index, index + 1)).tolist())
        return [*zip(statuses.id[span].tolist(), statuses.result[span].tolist(), strict=True)]

    def packets(self, kind: type[M]) -> Packets[M]:
        """Return all packets of a message class that these robots received."""
        packets = self._packets.get(kind)
        if packets is None:
            message_class(kind)
            table = self.received
            fields = decode_alike(kind, table.payloads, table.payload)
            if fields is None:  # messages of several classes were received
                table = self.tagged(kind.tag, kind.size_bytes)
                fields = decode_rows(kind, table.payloads, table.payload)
            packets = self._packets[kind] = Packets[M](self.n, table, fields, self.needs)
        return packets

    @property
    def received_lists(self) -> ReceivedLists:
        """Packets that these robots received, for agents of one robot each."""
        if self._lists is None:
            self._lists = ListsOfTable(self.received, self.needs)
        return self._lists

    def tagged(self, tag: int, size_bytes: int) -> ReceivedPackets:
        """Return the received packets with a tag and of this size."""
        matches = (self.received.payloads.tags() == tag) & (self.received.payloads.sizes == size_bytes)
        if matches.all():
            return self.received
        return self.received.select(np.flatnonzero(matches[self.received.payload]))

    def send(self, row: IntArray | None, to: IntArray | int | None, payloads: Payloads) -> IntArray:
        """Queue a packet for each of the robots `row` (rising, each once; None: for all); return their ids."""
        index = slice(None) if row is None else row
        receiver = np.empty(len(payloads), np.int64)
        receiver.fill(BROADCAST)
        if to is not None:
            receiver[:] = to
            if (receiver < 0).any() or (receiver != to).any():
                raise ValueError(f"send(to=…): expected the index of a robot in the arena, 0 or more, got {to}")
        ids = self._sent_counts[index].copy()
        self._sent_counts[index] += 1
        # Only agents that need statuses get any; no others cross the wire.
        tx_status_id = np.where(receiver == BROADCAST, NO_TX_STATUS, ids) if self._needs_tx_status else None
        self._outbox.append(SentPackets(self.readings.rows[index], receiver, payloads, tx_status_id))
        return ids

    def command(self, index: int, linear_mps: float, angular_radps: float, lateral_mps: float) -> None:
        """Command one robot's speeds; the last command of a tick counts."""
        self.drive[index] = True
        self.linear_mps[index], self.angular_radps[index], self.lateral_mps[index] = (
            linear_mps,
            angular_radps,
            lateral_mps,
        )

    def send_one(self, index: int, to: int | None, payload: bytes) -> int:
        """Queue a packet of one robot; return its id."""
        receiver = receiver_of(to)
        id_ = self._sent_counts.item(index)
        self._sent_counts[index] = id_ + 1
        tx_status_id = np.array((NO_TX_STATUS if to is None else id_,)) if self._needs_tx_status else None
        sender = self.readings.rows[index : index + 1]
        self._outbox.append(SentPackets(sender, np.array((receiver,)), Payloads.from_row(payload), tx_status_id))
        return id_

    def leds(self, led: int | None) -> FloatArray:
        """Return the new colours of one LED of each body, or of all, (n, leds), to write into.

        Errors as `led_slots`.
        """
        slots = self.led_slots(led)
        return self._table("leds", self.group.body.led_count)[:, slots]

    def led_one(self, index: int, led: int | None, rgb: int) -> None:
        """Set the colour of one LED of one robot, or of all; the last colour counts. Errors as `led_slots`."""
        self.leds(led)[index] = rgb

    def note(self, rows: BoolArray | slice, state: str | None, value: ArrayLike | None) -> None:
        """Note a state of some robots, and a number: (n,) or one for all. The last note of a tick counts.

        ValueError as `check_note`, and for numbers of a wrong shape or not finite.
        """
        check_note(state, value)
        numbers = None if value is None else self._numbers(rows, value)
        if state is not None:
            self._table("notes", 1)[rows, 0] = self._states.setdefault(state, len(self._states))
        if numbers is not None:
            self._table("values", 1)[rows, 0] = numbers

    def note_one(self, index: int, state: str | None, value: float | None) -> None:
        """Note a state of one robot, and a number; ValueError as `note`."""
        self.note(slice(index, index + 1), state, value)

    def _numbers(self, rows: BoolArray | slice, value: ArrayLike) -> FloatArray:
        """Return the numbers of these rows; ValueError for a wrong shape, or if one is not finite."""
        numbers = np.asarray(value, np.float64)
        if numbers.ndim and numbers.shape != (self.n,):
            raise ValueError(f"note(value=…): expected one number or {self.n}, got the shape {numbers.shape}")
        numbers = np.broadcast_to(numbers, self.n)[rows]
        if not np.isfinite(numbers).all():
            raise ValueError(f"note(value=…): expected finite numbers, got {value!r}")
        return numbers

    def mask(self, rows: BoolArray) -> BoolArray:
        """Return the mask of a VectorAgent; TypeError unless it is bool (n,)."""
        mask = np.asarray(rows)
        if mask.dtype != np.bool_ or mask.shape != (self.n,):
            raise TypeError(f"rows: expected a mask, bool ({self.n},), got {mask.dtype} {mask.shape}")
        return mask

    def end(self) -> Actions:
        """Return the robots' actions; handles of this tick raise RuntimeError from now on."""
        tables = {
            name: SparseTable.from_dense(self.readings.rows, values, tuple(self._states) if name == "notes" else ())
            for name, values in self._tables.items()
        }
        command = self.linear_mps, self.angular_radps, self.lateral_mps
        actions = Actions(self.readings.rows, self.drive, *command, SentPackets.joined(self._outbox), **tables)
        vars(self).clear()
        return actions

    def end_receive(self) -> SentPackets:
        """Return the packets that the robots sent in `on_receive`; RuntimeError if they acted in another way."""
        actions = self.end()
        if actions.drive.any() or any(len(getattr(actions, name)) for name in TABLES):
            raise RuntimeError("on_receive(…) reads packets and sends; to drive, light, actuate or note is for step(…)")
        return actions.sent
