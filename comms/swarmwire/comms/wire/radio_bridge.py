"""What a driver-run robot learns when it joins the medium of a world: msgpack, checked on arrival."""

import math
import struct
import threading
from collections import deque
from dataclasses import asdict, dataclass, fields
from typing import Generic, NamedTuple, TypeVar, cast

import msgpack
import numpy as np

from swarmwire.comms.clock import tick_start_ns
from swarmwire.comms.errors import BadFrame
from swarmwire.comms.packets import ReceivedPackets, TxStatuses
from swarmwire.comms.tick_io import GroupReadings
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.frames import MAX_BYTES, VERSION
from swarmwire.comms.wire.join import versioned
from swarmwire.comms.wire.tick_frames import decode_tick, encode_tick


@dataclass(frozen=True, slots=True)
class BridgeInfo:
    """A radio of the world as one robot knows it."""

    row: int  # the robot's, in the world
    robots: tuple[str, ...]  # all robots of its arena, by index
    rate_hz: int  # ticks of the world per second
    max_payload_bytes: int
    measures: tuple[str, ...]  # columns of `ReceivedPackets.given`
    needs: tuple[str, ...]  # what of an agent's needs it meets

    def encode(self) -> bytes:
        """The terms as bytes."""
        return msgpack.packb({"v": VERSION, **asdict(self)})

    @classmethod
    def decode(cls, data: bytes) -> "BridgeInfo":
        """The terms of these bytes; BadFrame if they are none, "version" if they are of another version."""
        values = versioned(data, MAX_BYTES)  # with the names of all robots
        del values["v"]
        if values.keys() != {of.name for of in fields(cls)}:
            raise BadFrame("malformed", "expected the terms of a medium")
        for name in ("row", "rate_hz", "max_payload_bytes"):
            if type(values[name]) is not int or values[name] < (name == "rate_hz"):
                raise BadFrame("malformed", f"{name}: expected a whole number")
        for name in ("robots", "measures", "needs"):
            texts = values[name]
            if type(texts) is not list or not all(type(text) is str for text in cast("list[object]", texts)):
                raise BadFrame("malformed", f"{name}: expected a list of texts")
            values[name] = tuple(cast("list[str]", texts))
        return cls(**values)


# --- What the world's air tells a driver-run robot in a tick: a `tick` frame without senses, checked on arrival.


GROUP = "air"  # stands for the robot's own group, of which nothing is told
MAX_RADIO_FRAME_BYTES = 2**20  # of a frame, either way
LAST_NS = 2**62  # no run comes so far; later times do not fit those that are told with packets


def encode_bridged(tick: int, row: int, received: ReceivedPackets, tx_status: TxStatuses) -> bytes:
    """The frame to the robot of this row: what it received, and what became of its packets."""
    return encode_tick(tick, {GROUP: GroupReadings(np.array([row]), {})}, received, tx_status)


def decode_bridged(data: bytes, terms: BridgeInfo) -> tuple[int, ReceivedPackets, TxStatuses]:
    """The tick and what `encode_bridged` was given.

    BadFrame if the frame is none, contradicts itself or is for another.
    """
    frame = frames.decode(data, MAX_RADIO_FRAME_BYTES)
    if frame.kind != "tick" or not 0 <= tick_start_ns(frame.tick, terms.rate_hz) < LAST_NS:
        raise BadFrame("malformed", f"{frame.kind} {frame.tick}, expected a tick")
    _, received, tx_status = decode_tick(frame, terms.measures, {GROUP})
    if ((received.sender < 0) | (received.sender >= len(terms.robots)) | (received.receiver != terms.row)).any():
        raise BadFrame("malformed", "received/numbers: expected packets of the robot's arena to itself")
    if (tx_status.row != terms.row).any():
        raise BadFrame("malformed", "tx_status: expected the robot's own")
    return frame.tick, received, tx_status


# --- An inbox between the network's thread and a loop: it holds so much, and counts what it had no room for.


T = TypeVar("T")


class BoundedInbox(Generic[T]):
    """What arrived since the loop looked last, in order; when it is full, what arrives is lost, as in any receiver.

    Attributes:
        dropped: what it had no room for so far.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._waiting: deque[T] = deque()
        self._lock = threading.Lock()
        self.dropped = 0

    def put(self, item: T) -> None:
        """Called from the network's threads; it returns at once."""
        with self._lock:
            if len(self._waiting) < self._most:
                self._waiting.append(item)
            else:
                self.dropped += 1

    def take(self) -> list[T]:
        """All that waits, oldest first."""
        with self._lock:
            taken = list(self._waiting)
            self._waiting.clear()
        return taken


# --- A robot's pose as trackers publish it: 32 bytes under the robot's key, `SwarmKeys.pose`.


_LAYOUT = struct.Struct("<3dq")  # x_m, y_m, heading_rad, ns since 1970
POSE_BYTES = _LAYOUT.size  # of a pose as it is told


class Pose(NamedTuple):
    """Where a robot is, in the tracker's frame."""

    x_m: float
    y_m: float
    heading_rad: float


def encode_pose(pose: Pose, utc_ns: int) -> bytes:
    """The pose that was seen at this time in ns since 1970."""
    return _LAYOUT.pack(*pose, utc_ns)


def decode_pose(data: bytes) -> tuple[Pose, int]:
    """The pose, and when it was seen, in ns since 1970; BadFrame ("malformed") if it is none, or not finite."""
    if len(data) != POSE_BYTES:
        raise BadFrame("malformed", f"{len(data)} bytes, expected {POSE_BYTES}")
    *place, utc_ns = _LAYOUT.unpack(data)
    if not all(map(math.isfinite, place)):
        raise BadFrame("malformed", "a pose that is not finite")
    return Pose(*place), utc_ns
