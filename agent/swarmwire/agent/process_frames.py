"""The layout of frames between an agent host and its agent processes, and their way through a socket.

All numbers are little-endian.

    to the process   ASSIGN    head; pickle: its part of the assignment, and the memory of earlier agents
                     TICK      head; for each group of its assignment: count, rows, records; packets
                     PACKETS   head; packets that arrived between two ticks
                     FIELDS    head; msgpack: the fields of the records of each group
    to the host      ACTIONS   head; rows, commands; sent packets; msgpack of `Extras`
                     READY     head
                     FAILED    head; msgpack of `Failure`

A record has the fields of a robot's sensors one after another, as 8-byte floats. Packets are heads, then transmit
statuses, then payloads. `process_ticks` writes and reads the frames of a tick, `process_answers` those to the host.
"""

from collections.abc import Sequence
from select import POLLOUT, poll
from socket import socket
from struct import Struct
from typing import Any, NamedTuple

import msgpack

from swarmwire.comms.base.errors import BadFrame
from swarmwire.comms.robot.tick_io import GroupReadings

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
KIND = Struct("<q")  # the second integer of each head
MAX_MESSAGE = 1 << 16  # bytes of a message of a socket; a larger frame is several
SEND_TIMEOUT_MS = 1000  # limit for a process that does not empty its full socket
NOT_ACTING = -1


class RecordField(NamedTuple):
    """The numbers of "sensor.field" in a record, from `first` to before `last`."""

    name: str
    first: int
    last: int
    is_single: bool  # one number per robot: (n,) in arrays, not (n, 1)


RecordFields = tuple[RecordField, ...]
Buffers = list[bytes | memoryview]  # parts of one frame, in their order


class ProcessFrame(NamedTuple):
    """A frame to one process; without buffers: none is sent."""

    buffers: Buffers
    rows: bytes = b""  # robot rows that act in it; the answer must repeat them


def record_fields(readings: GroupReadings) -> RecordFields:
    """Return the fields of a group's records, in the order of the readings."""
    fields: list[RecordField] = []
    first = 0
    for name, column in readings.fields.items():
        last = first + (1 if column.ndim == 1 else column.shape[1])
        fields.append(RecordField(name, first, last, column.ndim == 1))
        first = last
    return tuple(fields)


def packet_struct(measures: int) -> Struct:
    """Return the struct of a packet's head with this number of measurements."""
    return Struct(f"<{PACKET_NUMBERS}q{measures}d")


def answer_head(tick: int, robots: int, packets: int, payload_bytes: int, extras: bytes = b"") -> bytes:
    """Return the head of a frame ACTIONS."""
    robot_bytes, packet_bytes = robots * (ROW.size + COMMAND.size), packets * SENT_PACKET.size
    size = ANSWER_HEAD.size + robot_bytes + packet_bytes + payload_bytes + len(extras)
    return ANSWER_HEAD.pack(size, ACTIONS, tick, robots, packets, payload_bytes)


def content_frame(kind: int, content: object) -> bytes:
    """Encode a frame with a content as msgpack."""
    data = msgpack.packb(content)
    return ANSWER_HEAD.pack(ANSWER_HEAD.size + len(data), kind, -1, 0, 0, 0) + data


def frame_kind(frame: bytes) -> int:
    """Return the kind of a frame."""
    return KIND.unpack_from(frame, KIND.size)[0]


def receive(sock: socket) -> bytes:
    """Wait for the next frame; it is empty if the other end is closed."""
    parts: list[bytes] = []
    while (frame := receive_part(sock, parts)) is None:
        pass
    return frame


def receive_part(sock: socket, parts: list[bytes], max_bytes: int = 1 << 62) -> bytes | None:
    """Receive one message; return the frame that it completes, an empty frame if the other end is closed, or None.

    `parts` holds the messages of an incomplete frame. BadFrame for a frame of another length than in its head, and at
    the first message of one longer than `max_bytes`.
    """
    data = sock.recv(MAX_MESSAGE)
    if not data:
        return data
    if not parts and ANSWER_HEAD.size <= len(data) < MAX_MESSAGE and KIND.unpack_from(data)[0] == len(data):
        return data  # in most cases a frame is one message
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
            writable = poll()  # `select` refuses files above 1023, and a host has a socket per robot
            writable.register(sock, POLLOUT)
            writable.poll(SEND_TIMEOUT_MS)
            sock.send(data[start : start + MAX_MESSAGE])


def frame_content(frame: bytes) -> Any:
    """Decode the content of a frame by `content_frame`."""
    return msgpack.unpackb(frame[ANSWER_HEAD.size :])
