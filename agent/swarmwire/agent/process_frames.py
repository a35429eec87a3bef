"""Frames between an agent host and its agent processes: fixed records, cut by slices of arrays.

All numbers are little-endian. The host writes the records of all its robots at once and cuts them by process. A process
of one robot reads its part with `struct` alone, without numpy.

    to the process   ASSIGN    head; pickle: its part of the assignment, and the memory of earlier agents
                     TICK      head; for each group of its assignment: count, rows, records; packets
                     PACKETS   head; packets: those that arrived between two ticks
                     FIELDS    head; msgpack: the fields of the records of each group
    to the host      ACTIONS   head; rows, commands; sent packets; msgpack of what is set seldom, and of memory
                     READY     head
                     FAILED    head; msgpack

A record has the fields of a robot's sensors one after another, as 8-byte floats. Packets are heads, then transmit
statuses, then payloads. A process trusts its host. The host trusts no process, since it runs the user's code:
`process_answers` checks what the host reads.
"""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from select import POLLOUT, poll
from socket import socket
from struct import Struct
from typing import Any, NamedTuple

import msgpack
import numpy as np

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.errors import BadFrame
from swarmwire.comms.robot.packets import (
    NO_TX_STATUSES,
    Payloads,
    ReceivedPackets,
    TxStatuses,
    offsets,
)
from swarmwire.comms.robot.tick_io import GroupReadings, Readings

TICK, PACKETS, FIELDS, READY, ACTIONS, FAILED, ASSIGN = range(7)  # kinds of frames

HEAD = Struct("<7q")  # bytes of the frame, kind, tick, time in ns, packets, statuses, bytes of the payloads
COUNT = Struct("<q")  # acting robots of a group; NOT_ACTING: the group does not act in this tick
ROW = Struct("<q")
TICK_OF_ONE = Struct("<9q")  # HEAD, COUNT and ROW: a tick of a process whose only robot acts
STATUS = Struct("<3q")  # row, id, result
PACKET_NUMBERS = 5  # receiver row, sender, sequence, received_at_ns, size in bytes; then the measurements
ANSWER_HEAD = Struct("<6q")  # bytes of the frame, kind, tick, robots, packets, bytes of their payloads
COMMAND = Struct("<4d")  # drive (1 or 0), linear_mps, angular_radps, lateral_mps
ANSWER_OF_ONE = Struct("<7q4d")  # ANSWER_HEAD, ROW and COMMAND: the answer of a process whose only robot acted
SENT_PACKET = Struct("<4q")  # sender row, to, tx status id or NO_TX_STATUS, size in bytes
KIND = Struct("<q")  # after the bytes of the frame
MAX_MESSAGE = 1 << 16  # bytes of a message of a socket; a larger frame is several
SEND_TIMEOUT_MS = 1000  # for a process to read what fills its socket
NOT_ACTING = -1


class RecordField(NamedTuple):
    """The place of "sensor.field" in a record: the numbers from `first` to before `last`."""

    name: str
    first: int
    last: int
    is_single: bool  # one number per robot: (n,) in arrays, not (n, 1)


RecordFields = tuple[RecordField, ...]
Buffers = list[bytes | memoryview]  # of one frame, to be sent one after another


class FramePart(NamedTuple):
    """A frame of one process; empty for a process that has none."""

    buffers: Buffers
    rows: bytes = b""  # robot rows that act in it, as they must be in the answer


def record_fields(readings: GroupReadings) -> RecordFields:
    """The fields of a group's records, in the order of the readings."""
    fields: list[RecordField] = []
    first = 0
    for name, column in readings.fields.items():
        last = first + (1 if column.ndim == 1 else column.shape[1])
        fields.append(RecordField(name, first, last, column.ndim == 1))
        first = last
    return tuple(fields)


def packet_struct(measures: int) -> Struct:
    """The struct of a packet's head, with so many measurements."""
    return Struct(f"<{PACKET_NUMBERS}q{measures}d")


def owners(rows: Sequence[Mapping[str, IntArray]]) -> IntArray:
    """The process of each robot row, -1 without one; `rows` are those of each process, by group: rising."""
    last = 1 + max(int(of_group[-1]) for of in rows for of_group in of.values())
    owner = np.full(last, -1)
    for process, of in enumerate(rows):
        for of_group in of.values():
            owner[of_group] = process
    return owner


# The host's side: cutting a tick.


class TickCutter:
    """Cuts the tick of a host into one frame for each of its processes.

    The cost is a few operations on arrays for all robots, and a few slices for each process.
    """

    def __init__(self, rows: Sequence[dict[str, IntArray]], measures: tuple[str, ...]) -> None:
        """`rows` are those of each process, by group: rising, and each robot in one process."""
        self._measures = measures
        self._groups = [tuple(of) for of in rows]
        names = dict.fromkeys(name for of in rows for name in of)
        self._owner = owners(rows)
        self._processes = len(rows)
        self._names = tuple(names)

    def tick(self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses) -> list[FramePart]:
        """Each process's frame "tick"."""
        parts = {name: self._records(group) for name, group in readings.items()}
        packets = self._packets(received, tx_status)
        frames: list[FramePart] = []
        for process, names in enumerate(self._groups):
            buffers: Buffers = []
            acting: Buffers = []
            acts = False
            for name in names:
                if name not in parts:
                    buffers.append(COUNT.pack(NOT_ACTING))
                    continue
                acts = True
                rows, records, first, record_bytes = parts[name]
                a, b = first[process], first[process + 1]
                buffers.append(COUNT.pack(b - a))
                if b > a:
                    acting.append(rows[a * ROW.size : b * ROW.size])
                    buffers += (acting[-1], records[a * record_bytes : b * record_bytes])
            if acts:
                frames.append(FramePart(_with_head(TICK, tick, 0, buffers, packets[process]), b"".join(acting)))
            else:
                frames.append(FramePart([]))
        return frames

    def packets(self, tick: int, at_ns: int, received: ReceivedPackets, tx_status: TxStatuses) -> list[FramePart]:
        """Each process's frame "packets"; empty for a process without any."""
        return [
            FramePart(_with_head(PACKETS, tick, at_ns, [], part) if part.packets or part.statuses else [])
            for part in self._packets(received, tx_status)
        ]

    def _records(self, group: GroupReadings) -> tuple[memoryview, memoryview, list[int], int]:
        """Rows and records of all processes, the place of each process's first, and the bytes of a record."""
        n = len(group.rows)
        columns = [column if column.ndim == 2 else column[:, None] for column in group.fields.values()]
        records = np.concatenate(columns, axis=1) if columns else np.empty((n, 0))
        owner, rows = self._owner[group.rows], group.rows
        if np.count_nonzero(owner[1:] < owner[:-1]):  # a process has robots between those of another
            order = np.argsort(owner, kind="stable")
            owner, rows, records = owner[order], rows[order], records[order]
        first = np.searchsorted(owner, np.arange(self._processes + 1)).tolist()
        return memoryview(rows.tobytes()), memoryview(records.tobytes()), first, 8 * records.shape[1]

    def _packets(self, received: ReceivedPackets, tx_status: TxStatuses) -> "list[_PacketsPart]":
        """The packets and statuses of each process."""
        every = np.arange(self._processes + 1)
        owner = self._owner[received.receiver]
        if np.count_nonzero(owner[1:] < owner[:-1]):
            order = np.argsort(owner, kind="stable")
            owner, received = owner[order], received.select(order)
        payloads = received.payloads.select(received.payload)
        size = PACKET_NUMBERS + len(self._measures)
        heads = np.empty((len(received), size))
        numbers = (received.receiver, received.sender_index, received.sequence, received.received_at_ns, payloads.sizes)
        heads.view(np.int64)[:, :PACKET_NUMBERS] = np.array(numbers).T
        for place, name in enumerate(self._measures, PACKET_NUMBERS):
            heads[:, place] = received.measured[name]
        first = np.searchsorted(owner, every)
        first_byte = payloads.offset[first].tolist()
        status_owner = self._owner[tx_status.row]
        order = np.argsort(status_owner, kind="stable")
        first_status = np.searchsorted(status_owner[order], every).tolist()
        statuses = memoryview(np.array((tx_status.row, tx_status.id, tx_status.result)).T[order].tobytes())
        head_bytes, data = memoryview(heads.tobytes()), memoryview(payloads.data.tobytes())
        return [
            _PacketsPart(
                b - a,
                t - s,
                head_bytes[8 * size * a : 8 * size * b],
                statuses[STATUS.size * s : STATUS.size * t],
                data[p:q],
            )
            for (a, b), (p, q), (s, t) in zip(
                pairwise(first.tolist()), pairwise(first_byte), pairwise(first_status), strict=True
            )
        ]


class _PacketsPart(NamedTuple):
    """The packets and statuses of one process."""

    packets: int
    statuses: int
    heads: memoryview
    status_rows: memoryview
    payloads: memoryview


def _with_head(kind: int, tick: int, at_ns: int, buffers: Buffers, part: _PacketsPart) -> Buffers:
    buffers += part[2:]
    size = HEAD.size + sum(map(len, buffers))
    return [HEAD.pack(size, kind, tick, at_ns, part.packets, part.statuses, len(part.payloads)), *buffers]


# The process's side for several robots, as arrays.


def read_tick(
    frame: bytes, groups: Sequence[str], fields: Mapping[str, RecordFields], measures: tuple[str, ...]
) -> tuple[int, Readings, ReceivedPackets, TxStatuses]:
    """The contents of a frame "tick" for a process with robots of these groups."""
    _, _, tick, _, *numbers = HEAD.unpack_from(frame)
    at, readings = HEAD.size, dict[str, GroupReadings]()
    for name in groups:
        (count,) = COUNT.unpack_from(frame, at)
        at += COUNT.size
        if count == NOT_ACTING:
            continue
        rows = np.frombuffer(frame, np.int64, count, at)
        at += rows.nbytes
        width = fields[name][-1].last if fields[name] else 0
        records = np.frombuffer(frame, np.float64, count * width, at).reshape(count, width)
        at += records.nbytes
        readings[name] = GroupReadings(rows, {of.name: _column(records, of) for of in fields[name]})
    received, tx_status = _read_packets(frame, at, numbers, measures)
    return tick, readings, received, tx_status


def _column(records: FloatArray, field: RecordField) -> FloatArray:
    values = records[:, field.first] if field.is_single else records[:, field.first : field.last]
    column = np.ascontiguousarray(values)
    column.setflags(write=False)
    return column


def read_packets(frame: bytes, measures: tuple[str, ...]) -> tuple[int, int, ReceivedPackets, TxStatuses]:
    """The tick, time in ns, packets and statuses of a frame "packets"."""
    _, _, tick, at_ns, *numbers = HEAD.unpack_from(frame)
    return tick, at_ns, *_read_packets(frame, HEAD.size, numbers, measures)


def _read_packets(
    frame: bytes, at: int, numbers: Sequence[int], measures: tuple[str, ...]
) -> tuple[ReceivedPackets, TxStatuses]:
    packets, statuses, size = numbers
    received, tx_status = ReceivedPackets.none(measures), NO_TX_STATUSES
    width = PACKET_NUMBERS + len(measures)
    after = at + 8 * packets * width
    if packets:
        heads = np.frombuffer(frame, np.float64, packets * width, at).reshape(packets, width)
        receiver, sender, sequence, received_at_ns, sizes = heads.view(np.int64)[:, :PACKET_NUMBERS].T.copy()
        given = {name: heads[:, place].copy() for place, name in enumerate(measures, PACKET_NUMBERS)}
        payloads = Payloads(np.frombuffer(frame, np.uint8, size, after + statuses * STATUS.size), offsets(sizes))
        received = ReceivedPackets(receiver, sender, sequence, received_at_ns, given, np.arange(packets), payloads)
    if statuses:
        tx_status = TxStatuses(*np.frombuffer(frame, np.int64, 3 * statuses, after).reshape(statuses, 3).T.copy())
    return received, tx_status


def answer_head(tick: int, robots: int, packets: int, payload_bytes: int, rest: bytes = b"") -> bytes:
    """The head of a frame ACTIONS."""
    size = (
        ANSWER_HEAD.size + robots * (ROW.size + COMMAND.size) + packets * SENT_PACKET.size + payload_bytes + len(rest)
    )
    return ANSWER_HEAD.pack(size, ACTIONS, tick, robots, packets, payload_bytes)


def message(kind: int, content: object) -> bytes:
    """A frame of msgpack."""
    data = msgpack.packb(content)
    return ANSWER_HEAD.pack(ANSWER_HEAD.size + len(data), kind, -1, 0, 0, 0) + data


def frame_kind(frame: bytes) -> int:
    """The kind of a frame."""
    return KIND.unpack_from(frame, KIND.size)[0]


def receive(sock: socket) -> bytes:
    """The next frame; empty if the other end is closed."""
    parts: list[bytes] = []
    while (frame := receive_part(sock, parts)) is None:
        pass
    return frame


def receive_part(sock: socket, parts: list[bytes], max_bytes: int = 1 << 62) -> bytes | None:
    """Receive one message; returns the frame that it ends, empty if the other end is closed, or None.

    `parts` holds the messages of a frame that is not yet whole. BadFrame for a frame that is not as long as its head
    says, or longer than `max_bytes`: the latter at its first message.
    """
    data = sock.recv(MAX_MESSAGE)
    if not data:
        return data
    if not parts and ANSWER_HEAD.size <= len(data) < MAX_MESSAGE and KIND.unpack_from(data)[0] == len(data):
        return data  # the usual case
    parts.append(data)
    if len(parts[0]) < ANSWER_HEAD.size:
        raise BadFrame("malformed", f"{len(data)} bytes, expected a head")
    (size,) = KIND.unpack_from(parts[0])
    if size > max_bytes:
        raise BadFrame("oversized", f"{size} bytes, expected at most {max_bytes}")
    received = len(data) if len(parts) == 1 else sum(map(len, parts))
    if received < size and len(data) == MAX_MESSAGE:
        return None
    if received != size:
        raise BadFrame("malformed", f"{received} bytes, expected {size}")
    frame = data if len(parts) == 1 else b"".join(parts)
    parts.clear()
    return frame


def send(sock: socket, buffers: Sequence[bytes | memoryview]) -> None:
    """Send one frame; OSError if the other end is closed, or reads nothing for a second."""
    if sum(map(len, buffers)) < MAX_MESSAGE:
        sock.sendmsg(buffers)
        return
    data = memoryview(b"".join(buffers))
    for start in range(0, len(data), MAX_MESSAGE):
        try:
            sock.send(data[start : start + MAX_MESSAGE])
        except BlockingIOError:
            writable = poll()  # `select` takes no file above 1023, and a host has a socket per robot
            writable.register(sock, POLLOUT)
            writable.poll(SEND_TIMEOUT_MS)
            sock.send(data[start : start + MAX_MESSAGE])


def content(frame: bytes) -> Any:
    """The content of a frame by `message`."""
    return msgpack.unpackb(frame[ANSWER_HEAD.size :])
