"""The agent of one robot in a process of its own: a step without arrays.

Packets, numbers of sensors and commands are plain floats and tuples, read and written with `struct`: in a process that
shares its cores with hundreds of others, each use of numpy costs cold memory. An array is made only if the agent asks
for one, as with the rays of a scan. The results equal those of `AgentExecutor`, bit for bit.
"""

from collections.abc import Iterator, Mapping
from math import isfinite
from struct import Struct
from typing import Any, cast

import numpy as np

from swarmwire.agent.agent import Agent
from swarmwire.agent.agent_group import ACTED, DRAWS_PER_CALL, FIRST_ID, SENT, agent_failure
from swarmwire.agent.packet import ReceivedLists
from swarmwire.agent.parameters import make_agent
from swarmwire.agent.process_answers import extras_data
from swarmwire.agent.process_frames import (
    ACTIONS,
    ANSWER_OF_ONE,
    COUNT,
    HEAD,
    NOT_ACTING,
    PACKET_NUMBERS,
    SENT_PACKET,
    STATUS,
    TICK,
    TICK_OF_ONE,
    RecordFields,
    answer_head,
    packet_struct,
)
from swarmwire.agent.robot import Robot
from swarmwire.agent.step_context import TX_STATUS, DrawKeys, StepContext, StepTime, check_note, receiver_of
from swarmwire.comms.base.clock import tick_start_ns
from swarmwire.comms.base.sentinels import BROADCAST, NO_TX_STATUS
from swarmwire.comms.robot.packets import TAG_BYTES
from swarmwire.comms.robot.sensors.sensor import SensorProperty
from swarmwire.comms.wire.agent_memory import GroupMemories, GroupMemory
from swarmwire.comms.wire.assignment import Assignment

Packet = tuple[tuple[Any, ...], bytes]  # head: receiver row, sender, sequence, received_at_ns, size, measurements
Status = tuple[int, int, int]  # row, id, result
COLUMNS = {"receiver": 0, "sender_index": 1, "sequence": 2, "received_at_ns": 3}  # indices in the head
FLOAT = Struct("<d")
NO_COMMAND = 0.0, 0.0, 0.0, 0.0


class OneRobotLists(ReceivedLists):
    """The packets that one robot received."""

    __slots__ = ("_measures", "_packets")

    def __init__(self, packets: list[Packet], measures: tuple[str, ...], needs: tuple[str, ...]) -> None:
        super().__init__(needs)
        self._packets, self._measures = packets, measures

    def payloads(self, row: int, tag: int, size_bytes: int | None = None) -> Iterator[tuple[int, bytes, int, int]]:
        """Yield the payloads with a tag and, unless it is None, of this size; `row` is 0."""
        low, high = tag & 0xFF, tag >> 8
        for index, (_, payload) in enumerate(self._packets):
            size = len(payload)
            fits = size >= TAG_BYTES if size_bytes is None else size == size_bytes
            if fits and payload[0] == low and payload[1] == high:
                yield index, payload, 0, size

    def _list(self, name: str) -> list[Any]:
        index = COLUMNS[name] if name in COLUMNS else PACKET_NUMBERS + self._measures.index(name)
        return [head[index] for head, _ in self._packets]


class RobotContext(StepContext):
    """One robot in one tick, without arrays."""

    def __init__(
        self,
        agent: "OneRobotAgent",
        time: StepTime,
        frame: bytes,
        packets: list[Packet],
        statuses: list[Status],
        first_draw: int = 0,
    ) -> None:
        """Begin; `frame` has the robot's readings, and the lists are in the order of their tables."""
        super().__init__(agent.group, agent.needs, time, DrawKeys(agent.group.keys, first_draw))
        self._agent, self._frame, self._received, self._statuses = agent, frame, packets, statuses
        self._command: tuple[float, float, float, float] = NO_COMMAND
        self._outbox: list[tuple[tuple[int, int, int, int], bytes]] = []
        self._notes: dict[str, Any] = {}  # noted in this tick, as in `Extras`
        self._leds: dict[int, float] = {}  # colours that were set in this tick, by LED
        self._lists: OneRobotLists | None = None

    def reading(self, sensor: SensorProperty[Any, Any], index: int) -> list[Any]:
        """Return the fields of a built-in sensor, each a float or (width,); NotDeclared as `fields`."""
        self._require(sensor.name)
        return [self._value(column) for column in sensor.columns]

    def fields(self, sensor: str) -> Mapping[str, Any]:
        """Return all fields of a sensor by name; NotDeclared if the agent's needs do not name the sensor."""
        self._require(sensor)
        prefix = f"{sensor}."
        names = [name for name in self._agent.fields if name.startswith(prefix)]
        return {name.removeprefix(prefix): (np.asarray(self._value(name)),) for name in names}

    def _value(self, column: str) -> Any:
        first, last, is_single = self._agent.fields[column]
        if is_single:
            return FLOAT.unpack_from(self._frame, first)[0]
        return memoryview(self._frame)[first:last].cast("d")

    @property
    def received_lists(self) -> OneRobotLists:
        """Packets that the robot received."""
        if self._lists is None:
            self._lists = OneRobotLists(self._received, self._agent.measures, self.needs)
        return self._lists

    def tx_statuses_of(self, index: int) -> list[tuple[int, int]]:
        """Return id and result of packets that the robot sent; NotDeclared if the agent's needs do not name them."""
        self._require(TX_STATUS)
        return [(id_, result) for _, id_, result in self._statuses]

    def command(self, index: int, linear_mps: float, angular_radps: float, lateral_mps: float) -> None:
        """Command the robot's speeds; the last command of a tick counts."""
        self._command = 1.0, float(linear_mps), float(angular_radps), float(lateral_mps)

    def send_one(self, index: int, to: int | None, payload: bytes) -> int:
        """Queue a packet; return its id."""
        receiver, id_ = receiver_of(to), self._agent.sent
        self._agent.sent = id_ + 1
        tx_status_id = id_ if receiver != BROADCAST and self._needs_tx_status else NO_TX_STATUS
        self._outbox.append(((self._agent.row, receiver, tx_status_id, len(payload)), payload))
        return id_

    def led_one(self, index: int, led: int | None, rgb: int) -> None:
        """Set the colour of one LED, or of all; the last colour counts. Errors as `led_slots`."""
        slots = self.led_slots(led)
        self._leds.update(dict.fromkeys(range(slots.start, slots.stop), float(rgb)))

    def note_one(self, index: int, state: str | None, value: float | None) -> None:
        """Note the robot's state, and a number; ValueError as `check_note`, and for a number that is not finite."""
        check_note(state, value)
        rows = [self._agent.row]
        if value is not None:
            if not isfinite(value):
                raise ValueError(f"note(value=…): expected finite numbers, got {value!r}")
            self._notes["values"] = rows, [0], [value]
        if state is not None:
            self._notes["notes"] = rows, [state]

    def end(self, robots: int = 1) -> bytes:
        """Return the frame "actions"; the handle of this tick raises RuntimeError from now on."""
        agent, outbox = self._agent, self._outbox
        extras = self._extras() if robots and (self._sets_more or agent.keeps_memory) else b""
        if outbox:
            payloads = b"".join([payload for _, payload in outbox])
            sent = b"".join([SENT_PACKET.pack(*head) for head, _ in outbox]) + payloads
        else:
            payloads = sent = b""
        if robots:
            size = ANSWER_OF_ONE.size + len(sent) + len(extras)
            numbers = (size, ACTIONS, self.tick, 1, len(outbox), len(payloads), agent.row)
            data = ANSWER_OF_ONE.pack(*numbers, *self._command) + sent + extras
        else:
            data = answer_head(self.tick, 0, len(outbox), len(payloads), extras) + sent + extras
        vars(self).clear()
        return data

    def end_receive(self) -> bytes:
        """Return a frame "actions" with the packets of `on_receive` alone; RuntimeError if the robot did more."""
        if self._command[0] or self._sets_more:
            raise RuntimeError("on_receive(…) reads packets and sends; to drive, light, actuate or note is for step(…)")
        return self.end(robots=0)

    @property
    def _sets_more(self) -> bool:
        """True if the agent set more than its command and packets."""
        return bool(self._notes or self._leds or self._tables)

    def _extras(self) -> bytes:
        """Return the sparse tables and the memory."""
        extras, row = self._notes, self._agent.row
        if self._leds:
            leds = sorted(self._leds)
            extras["leds"] = [row] * len(leds), leds, [self._leds[led] for led in leds]
        for name, values in self._tables.items():
            (slots,) = np.nonzero(~np.isnan(values[0]))
            extras[name] = [row] * len(slots), slots.tolist(), values[0, slots].tolist()
        return extras_data(extras, self._agent.memory() if self._agent.keeps_memory else None)


class OneRobotAgent:
    """The `Agent` of a process's only robot.

    Attributes:
        group: the robot's group, with this robot alone.
        row: the robot row.
        sent: packets that the robot has sent so far.
        fields: first byte and end of each field in a frame, and True for a single number.
        measures: the names of the medium's measurements.
    """

    def __init__(
        self,
        assignment: Assignment,
        kind: type[Agent],
        memory: GroupMemories | None = None,
        *,
        keeps_memory: bool = False,
    ) -> None:
        """Make the agent; AgentFailed if that fails. `memory` is that of an earlier agent of the robot.

        With `keeps_memory`, each answer has the robot's memory.
        """
        (self.group,) = assignment.groups
        self.needs, self.row, self.sent = kind.needs, int(self.group.rows[0]), 0
        if memory:
            self.sent = int(memory[self.group.name].columns[SENT][0])
        self.keeps_memory = keeps_memory
        self.fields: dict[str, tuple[int, int, bool]] = {}
        self.measures = assignment.measures or ()
        self.first_id = self.sent  # id of the first packet of this agent
        self.acted = True  # the robot stepped in the last tick of its group, or is new
        self._kind, self._rate_hz = kind, assignment.rate_hz
        self._receives = kind.on_receive is not Agent.on_receive
        self._head, self._record_bytes = packet_struct(len(self.measures)), 0
        self._waiting: tuple[list[Packet], list[Status]] = [], []  # arrived between ticks
        self._last_frame: bytes | None = None  # frame of the last step, for `on_receive`
        self._receive_calls = 0  # number of calls since the last step
        self._agent = self._new_agent()

    def memory(self) -> GroupMemories:
        """Return the robot's memory."""
        columns = {SENT: np.array([self.sent]), FIRST_ID: np.array([self.first_id]), ACTED: np.array([self.acted])}
        return {self.group.name: GroupMemory(self.group.rows, columns)}

    def set_fields(self, fields: Mapping[str, RecordFields]) -> None:
        """Set the fields of the records, by group, before the first tick."""
        (record,) = fields.values()
        start = TICK_OF_ONE.size
        self.fields = {name: (start + 8 * first, start + 8 * last, single) for name, first, last, single in record}
        self._record_bytes = 8 * (record[-1].last if record else 0)

    def act(self, frame: bytes) -> bytes:
        """Return the frame "actions" for a frame "tick" or "packets"; AgentFailed if the agent raises."""
        if len(frame) < TICK_OF_ONE.size:
            return self._answer_without_step(frame)
        _, kind, tick, _, count, status_count, _, acting, _ = TICK_OF_ONE.unpack_from(frame)
        if kind != TICK or acting != 1:
            return self._answer_without_step(frame)
        packets: list[Packet] = []
        statuses: list[Status] = []
        if count or status_count:
            packets, statuses = self._packets(frame, TICK_OF_ONE.size + self._record_bytes, count, status_count)
        if self._waiting[0] or self._waiting[1]:
            self._keep(packets, statuses)
            packets, statuses = self._waiting
            self._waiting = [], []
        if not self.acted:  # the robot returns with a new agent
            self._agent, self.first_id, self.acted = self._new_agent(), self.sent, True
        time = StepTime(tick, tick_start_ns(tick, self._rate_hz), self._period_ns(tick))
        context = RobotContext(self, time, frame, packets, statuses and self._current(statuses))
        self._last_frame, self._receive_calls = frame, 0
        try:
            self._agent.step(Robot(context, 0))
        except (Exception, SystemExit) as error:
            raise agent_failure(list(self.group.robot_names), error, context) from error
        return context.end()

    def _answer_without_step(self, frame: bytes) -> bytes:
        """Answer packets, or a tick in which the robot does not act since its group does not, or since it is dead."""
        _, kind, tick, at_ns, count, status_count, _ = HEAD.unpack_from(frame)
        if kind != TICK:
            self._keep(*self._packets(frame, HEAD.size, count, status_count))
            return self._on_receive(tick, at_ns)
        (acting,) = COUNT.unpack_from(frame, HEAD.size)
        packets, statuses = self._packets(frame, HEAD.size + COUNT.size, count, status_count)
        if acting == NOT_ACTING:
            self._keep(packets, statuses)
            return answer_head(tick, 0, 0, 0)
        self._waiting = [], []  # lost with the robot's agent
        self.acted = False
        extras = extras_data({}, self.memory() if self.keeps_memory else None)
        return answer_head(tick, 0, 0, 0, extras) + extras

    def _on_receive(self, tick: int, at_ns: int) -> bytes:
        if not self._receives or self._last_frame is None or not self.acted:
            return answer_head(tick, 0, 0, 0)
        (packets, statuses), self._waiting = self._waiting, ([], [])
        self._receive_calls += 1
        current, time = self._current(statuses), StepTime(tick, at_ns, self._period_ns(tick))
        context = RobotContext(self, time, self._last_frame, packets, current, self._receive_calls * DRAWS_PER_CALL)
        try:
            if packets or current:
                self._agent.on_receive(Robot(context, 0))
        except (Exception, SystemExit) as error:
            raise agent_failure(list(self.group.robot_names), error, context) from error
        try:
            return context.end_receive()
        except RuntimeError as error:
            raise agent_failure(list(self.group.robot_names), error) from error

    def _period_ns(self, tick: int) -> int:
        """Return the time from a tick to the robot's next."""
        next_tick = tick + self.group.act_every_ticks
        return tick_start_ns(next_tick, self._rate_hz) - tick_start_ns(tick, self._rate_hz)

    def _packets(
        self, frame: bytes, start: int, packet_count: int, status_count: int
    ) -> tuple[list[Packet], list[Status]]:
        """Return the packets and statuses of a frame; their heads begin at the byte `start`."""
        packets: list[Packet] = []
        heads_end = start + packet_count * self._head.size
        payload_start = statuses_end = heads_end + status_count * STATUS.size
        for head in self._head.iter_unpack(memoryview(frame)[start:heads_end]):
            payload_end = payload_start + head[4]
            packets.append((head, frame[payload_start:payload_end]))
            payload_start = payload_end
        if not status_count:
            return packets, []
        statuses = STATUS.iter_unpack(memoryview(frame)[heads_end:statuses_end])
        return packets, cast("list[Status]", list(statuses))

    def _keep(self, packets: list[Packet], statuses: list[Status]) -> None:
        """Keep packets and statuses until the robot steps or reads them, in the order of their tables."""
        if packets:
            self._waiting[0].extend(packets)
            self._waiting[0].sort(key=_reception_order)
        if statuses:
            self._waiting[1].extend(statuses)
            self._waiting[1].sort()

    def _current(self, statuses: list[Status]) -> list[Status]:
        """Return the statuses of packets of this agent, without those of an earlier agent."""
        return [status for status in statuses if self.first_id <= status[1] < self.sent]

    def _new_agent(self) -> Agent:
        try:
            return make_agent(self._kind, self.group.params)
        except (Exception, SystemExit) as error:
            raise agent_failure(list(self.group.robot_names), error) from error


def _reception_order(packet: Packet) -> tuple[int, int, int]:
    head, _ = packet
    return head[3], head[1], head[2]
