"""One tick of one group: what its robots sense and hear, and what they do, as arrays behind both kinds of handle."""

from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from swarmwire.agent.packet import NotDeclared, Packets, ReceivedLists
from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray, KeyArray
from swarmwire.comms.assignment import GroupAssignment
from swarmwire.comms.bodies.body import IncompatibleBody
from swarmwire.comms.messages import Message, decode_alike, decode_rows, message_class
from swarmwire.comms.packets import BROADCAST, NOT_MEASURED, Payloads, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.tick_io import (
    NO_ACTUATOR_COMMANDS,
    NO_LED_CHANGES,
    NO_VALUES,
    Actions,
    ActuatorCommands,
    GroupReadings,
    LedChanges,
    Notes,
    Values,
    checked_state,
)

M = TypeVar("M", bound=Message)
OUTCOMES = "radio.tx_status"  # what `needs` calls the tx statuses of addressed packets
NOT_SWITCHED = -1


class StepContext:
    """The robots `sensors.rows` of a group in one tick.

    `received.receiver` and `tx_status.row` count these rows from 0.
    """

    def __init__(
        self,
        group: GroupAssignment,
        needs: tuple[str, ...],
        time: tuple[int, int, int],
        readings: GroupReadings,
        received: ReceivedPackets,
        tx_status: TxStatuses,
        keys: KeyArray,
        sent_before: IntArray,
        first_draw: int = 0,
    ) -> None:
        self.first_draw = first_draw  # of the tick that it does not share with those before it
        self.group, self.needs = group, needs
        self.tick, self.time_ns, self.period_ns = time
        self.readings, self.received = readings, received
        self._tx_status, self._asks = tx_status, OUTCOMES in needs
        self.tx_status_rows = tx_status.row  # (k,) places of robots that there is an outcome for
        self.keys = keys  # (n,) of the robots' draws
        self.n = len(readings.rows)
        self.drive = np.zeros(self.n, np.bool_)
        self.linear_mps, self.angular_radps, self.lateral_mps = np.zeros((3, self.n))
        self._sent_before = sent_before  # (n,) packets that each robot has sent up to now; written to
        self._outbox: list[SentPackets] = []
        self._states: dict[str, int] = {}  # that were named in this tick, by code
        self._state: IntArray | None = None  # (n,) codes; -1: none named
        self._value: FloatArray | None = None  # (n,) numbers told in this tick; NaN: none
        self._leds: IntArray | None = None  # (n, leds) colours; NOT_SWITCHED: none given in this tick
        self._own: FloatArray | None = None  # (n, numbers of all own actuators); NaN: not set in this tick
        self._packets: dict[type[Message], Packets[Any]] = {}
        self._lists: ReceivedLists | None = None

    def field(self, sensor: str, name: str) -> FloatArray:
        """A field of a sense, (n, …); NotDeclared if the agent's needs do not name the sense."""
        self._require(sensor)
        return self.readings.fields[f"{sensor}.{name}"]

    def fields(self, sensor: str) -> dict[str, FloatArray]:
        """All fields of a sense, (n, …) each, by name; NotDeclared if the agent's needs do not name the sense."""
        self._require(sensor)
        of = f"{sensor}."
        return {name.removeprefix(of): values for name, values in self.readings.fields.items() if name.startswith(of)}

    def tx_status(self) -> TxStatuses:
        """What became of packets that these robots sent; NotDeclared if the agent's needs do not name it."""
        self._require(OUTCOMES)
        return self._tx_status

    def packets(self, kind: type[M]) -> Packets[M]:
        """All packets of a message class that these robots received."""
        known = self._packets.get(kind)
        if known is None:
            message_class(kind)
            table = self.received
            fields = decode_alike(kind, table.payloads, table.payload)
            if fields is None:  # messages of several kinds were received
                table = self.tagged(kind.tag, kind.size_bytes)
                fields = decode_rows(kind, table.payloads, table.payload)
            known = self._packets[kind] = Packets[M](self.n, table, fields, self.needs)
        return known

    @property
    def received_lists(self) -> ReceivedLists:
        """All that these robots received, for agents of one robot each."""
        if self._lists is None:
            self._lists = ReceivedLists(self.received, self.needs)
        return self._lists

    def tagged(self, tag: int, size_bytes: int | None = None) -> ReceivedPackets:
        """What was received with a tag and, if given, of this size."""
        wanted = self.received.payloads.tags() == tag
        if size_bytes is not None:
            wanted &= self.received.payloads.sizes == size_bytes
        if wanted.all():
            return self.received
        return self.received.select(np.flatnonzero(wanted[self.received.payload]))

    def send(self, row: IntArray | None, to: IntArray | int | None, payloads: Payloads) -> IntArray:
        """Queue a packet for each of the robots `row` (rising, each once; None: for all); returns their ids."""
        place = slice(None) if row is None else row
        receiver = np.empty(len(payloads), np.int64)
        receiver.fill(BROADCAST)
        if to is not None:
            receiver[:] = to
            if (receiver < 0).any() or (receiver != to).any():
                raise ValueError(f"send(to=…): expected the index of a robot in the arena, 0 or more, got {to}")
        ids = self._sent_before[place].copy()
        self._sent_before[place] += 1
        # Whoever does not ask is not told, and nothing of it crosses the wire.
        tx_status_id = np.where(receiver == BROADCAST, NOT_MEASURED, ids) if self._asks else None
        self._outbox.append(SentPackets(self.readings.rows[place], receiver, payloads, tx_status_id))
        return ids

    def send_one(self, place: int, to: int | None, payload: bytes) -> int:
        """Queue a packet of one robot; returns its id."""
        if to is None:
            receiver = BROADCAST
        elif to < 0 or int(to) != to:
            raise ValueError(f"send(to=…): expected the index of a robot in the arena, 0 or more, got {to}")
        else:
            receiver = int(to)
        id_ = self._sent_before.item(place)
        self._sent_before[place] = id_ + 1
        tx_status_id = np.array((NOT_MEASURED if to is None else id_,)) if self._asks else None
        sender = self.readings.rows[place : place + 1]
        self._outbox.append(SentPackets(sender, np.array((receiver,)), Payloads.one(payload), tx_status_id))
        return id_

    def mask(self, rows: BoolArray) -> BoolArray:
        """The mask that a VectorAgent gives; TypeError unless it is one."""
        given = np.asarray(rows)
        if given.dtype != np.bool_ or given.shape != (self.n,):
            raise TypeError(f"rows: expected a mask, bool ({self.n},), got {given.dtype} {given.shape}")
        return given

    def note(self, rows: BoolArray | slice, state: str | None, value: ArrayLike | None) -> None:
        """Name a state for some of the robots, and tell a number (n,) or for all; of each the last in a tick counts.

        ValueError if there is neither, or for one that is not fit to be told.
        """
        if state is None and value is None:
            raise ValueError("note(…): expected a state, a value, or both")
        given = None if value is None else self._told(rows, value)
        if state is not None:
            if self._state is None:
                self._state = np.full(self.n, -1)
            self._state[rows] = self._states.setdefault(checked_state(state), len(self._states))
        if given is not None:
            if self._value is None:
                self._value = np.full(self.n, np.nan)
            self._value[rows] = given

    def _told(self, rows: BoolArray | slice, value: ArrayLike) -> FloatArray:
        """The numbers of these rows, fit to be told; else ValueError."""
        given = np.asarray(value, np.float64)
        if given.ndim and given.shape != (self.n,):
            raise ValueError(f"note(value=…): expected one number or {self.n}, got the shape {given.shape}")
        given = np.broadcast_to(given, self.n)[rows]
        if not np.isfinite(given).all():
            raise ValueError(f"note(value=…): expected finite numbers, got {value!r}")
        return given

    def leds(self, which: int | None) -> IntArray:
        """The colours to switch an LED of each body to, or all, (n, leds), to write into; NotFitted if it has none."""
        body = self.group.body
        if not body.led_count:
            raise IncompatibleBody(f"the body {body.name} has no LEDs")
        if which is not None and not 0 <= which < body.led_count:
            raise ValueError(f"led(which=…): the body {body.name} has LEDs 0 to {body.led_count - 1}, got {which}")
        if self._leds is None:
            self._leds = np.full((self.n, body.led_count), NOT_SWITCHED)
        return self._leds if which is None else self._leds[:, which : which + 1]

    def actuate(self, name: str, values: ArrayLike, rows: slice, mask: BoolArray | None = None) -> None:
        """Set an actuator of the user's own of some of the robots to numbers (rows, width), or what goes for all.

        With a mask (rows,) it is set for the robots of the mask alone, and the numbers of others are not looked at.
        NotFitted if the body has none of this name, ValueError if the numbers do not fit or are not finite.
        """
        body = self.group.body
        if name not in body.actuators:
            has = ", ".join(body.actuators) or "none"
            raise IncompatibleBody(f"the body {body.name} has no actuator {name!r} of its own: it has {has}")
        given, width = np.asarray(values, np.float64), body.actuators[name].width
        if self._own is None:
            self._own = np.full((self.n, sum(spec.width for spec in body.actuators.values())), np.nan)
        of = self._own[rows, body.actuator_places[name]]
        if given.ndim == 1 and width == 1:
            given = given[:, None]  # (n,) is one number for each robot
        if given.ndim > 2 or (given.ndim and given.shape[-1] != width) or (given.ndim == 2 and len(given) != len(of)):
            raise ValueError(f"actuate({name!r}, …): expected {width} numbers, got the shape {np.shape(values)}")
        here = np.ones(len(of), np.bool_) if mask is None else mask
        given = np.broadcast_to(given, of.shape)[here]
        if not np.isfinite(given).all():
            raise ValueError(f"actuate({name!r}, …): expected finite numbers, got {values!r}")
        of[here] = given

    def end(self) -> Actions:
        """What the robots did; whoever still has a handle of this tick is refused from now on."""
        actions = self._actions()
        vars(self).clear()
        return actions

    if not TYPE_CHECKING:

        def __getattr__(self, name):
            raise RuntimeError("robot and radio hold for one step: use those that this step is given, keep none")

    def end_hearing(self) -> SentPackets:
        """What the robots sent between their steps; RuntimeError if they did anything else."""
        actions = self.end()
        others = actions.notes, actions.leds, actions.own, actions.values
        if actions.drive.any() or any(map(len, others)):
            raise RuntimeError("on_receive(…) reads packets and sends; to drive, light, actuate or note is for step(…)")
        return actions.sent

    def _actions(self) -> Actions:
        sent = SentPackets.joined(self._outbox)
        command = self.linear_mps, self.angular_radps, self.lateral_mps
        return Actions(
            self.readings.rows,
            self.drive,
            *command,
            sent,
            Notes.none() if self._state is None else self._notes(self._state),
            NO_LED_CHANGES if self._leds is None else self._led_changes(self._leds),
            NO_ACTUATOR_COMMANDS if self._own is None else self._actuations(self._own),
            NO_VALUES if self._value is None else self._values(self._value),
        )

    def _require(self, need: str) -> None:
        if need not in self.needs:
            raise NotDeclared(f"reads {need!r}, which its needs do not name: {', '.join(self.needs) or 'none'}")

    def _led_changes(self, leds: IntArray) -> LedChanges:
        place, which = np.nonzero(leds != NOT_SWITCHED)
        return LedChanges(self.readings.rows[place], which, leds[place, which])

    def _actuations(self, own: FloatArray) -> ActuatorCommands:
        at, place = np.nonzero(~np.isnan(own))
        return ActuatorCommands(self.readings.rows[at], place, own[at, place])

    def _notes(self, state: IntArray) -> Notes:
        noted = np.flatnonzero(state >= 0)
        return Notes(self.readings.rows[noted], state[noted], tuple(self._states))

    def _values(self, value: FloatArray) -> Values:
        told = np.flatnonzero(~np.isnan(value))
        return Values(self.readings.rows[told], value[told])
