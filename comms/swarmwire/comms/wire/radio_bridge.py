"""The bridge between robots run by drivers and the radio medium of a world: its frames, an inbox, and poses.

A robot that joins the medium gets a `BridgeInfo` (msgpack). For each tick in which the robot received packets, the
world sends it a `tick` frame without readings. A tracker publishes poses of 32 bytes. All are checked on arrival.
"""

import math
import struct
import threading
from collections import deque
from typing import Annotated, Generic, NamedTuple, TypeVar

import msgpack
import numpy as np
from msgspec import Meta, Struct
from msgspec.structs import asdict

from swarmwire.comms.base.clock import tick_start_ns
from swarmwire.comms.base.errors import BadFrame
from swarmwire.comms.robot.packets import ReceivedPackets, TxStatuses
from swarmwire.comms.robot.tick_io import GroupReadings
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.frames import VERSION, typed
from swarmwire.comms.wire.join import versioned
from swarmwire.comms.wire.limits import MAX_BYTES
from swarmwire.comms.wire.tick_frames import decode_tick, encode_tick

GROUP = "air"  # name on the wire in place of the robot's group, which has no readings in these frames
MAX_RADIO_FRAME_BYTES = 2**20  # size of a frame, in both directions
LAST_NS = 2**62  # later times do not fit the times of packets; no run lasts this long
_POSE_LAYOUT = struct.Struct("<3dq")  # x_m, y_m, heading_rad, ns since 1970
POSE_BYTES = _POSE_LAYOUT.size

T = TypeVar("T")


class BridgeInfo(Struct, frozen=True, forbid_unknown_fields=True):
    """Facts of the world's radio medium for one robot."""

    row: Annotated[int, Meta(ge=0)]  # row of the robot in the world
    robots: tuple[str, ...]  # names of all robots of its arena, by index
    rate_hz: Annotated[int, Meta(ge=1)]  # ticks of the world per second
    max_payload_bytes: Annotated[int, Meta(ge=0)]
    measures: tuple[str, ...]  # columns of `ReceivedPackets.measured`
    needs: tuple[str, ...]  # needs that the medium provides to agents

    def encode(self) -> bytes:
        """Encode the info."""
        return msgpack.packb({"v": VERSION, **asdict(self)})

    @classmethod
    def decode(cls, data: bytes) -> "BridgeInfo":
        """Decode an info; BadFrame if the bytes hold none, "version" if they are of another version."""
        values = versioned(data, MAX_BYTES)  # large: it has the names of all robots
        del values["v"]
        return typed(cls, values, "info")


def encode_bridged(tick: int, row: int, received: ReceivedPackets, tx_status: TxStatuses) -> bytes:
    """Encode the `tick` frame to the robot of this row, with its received packets and tx statuses."""
    return encode_tick(tick, {GROUP: GroupReadings(np.array([row]), {})}, received, tx_status)


def decode_bridged(data: bytes, info: BridgeInfo) -> tuple[int, ReceivedPackets, TxStatuses]:
    """Decode the tick, packets and statuses of a frame by `encode_bridged`.

    BadFrame if the frame is malformed, contradicts itself or is for another robot.
    """
    frame = frames.decode(data, MAX_RADIO_FRAME_BYTES)
    if frame.kind != "tick" or not 0 <= tick_start_ns(frame.tick, info.rate_hz) < LAST_NS:
        raise BadFrame("malformed", f"{frame.kind} {frame.tick}, expected a tick")
    _, received, tx_status = decode_tick(frame, info.measures, {GROUP})
    if (
        (received.sender_index < 0) | (received.sender_index >= len(info.robots)) | (received.receiver != info.row)
    ).any():
        raise BadFrame("malformed", "received/numbers: expected packets of the robot's arena to itself")
    if (tx_status.row != info.row).any():
        raise BadFrame("malformed", "tx_status: expected the robot's own")
    return frame.tick, received, tx_status


class BoundedInbox(Generic[T]):
    """A bounded queue between the network's thread and a loop; a full queue drops new items and counts them.

    Attributes:
        dropped: number of dropped items.
    """

    def __init__(self, max_items: int) -> None:
        self._max_items = max_items
        self._waiting: deque[T] = deque()
        self._lock = threading.Lock()
        self.dropped = 0

    def put(self, item: T) -> None:
        """Add an item; the network's threads call this, and it returns at once."""
        with self._lock:
            if len(self._waiting) < self._max_items:
                self._waiting.append(item)
            else:
                self.dropped += 1

    def pop_all(self) -> list[T]:
        """Remove and return all items, oldest first."""
        with self._lock:
            items = list(self._waiting)
            self._waiting.clear()
        return items


class Pose(NamedTuple):
    """Pose of a robot in the tracker's frame; trackers put it under the robot's key `SwarmKeys.pose`."""

    x_m: float
    y_m: float
    heading_rad: float


def encode_pose(pose: Pose, utc_ns: int) -> bytes:
    """Encode a pose and the time of its measurement in ns since 1970."""
    return _POSE_LAYOUT.pack(*pose, utc_ns)


def decode_pose(data: bytes) -> tuple[Pose, int]:
    """Decode a pose and its time in ns since 1970; BadFrame ("malformed") for other bytes or infinite numbers."""
    if len(data) != POSE_BYTES:
        raise BadFrame("malformed", f"{len(data)} bytes, expected {POSE_BYTES}")
    *numbers, utc_ns = _POSE_LAYOUT.unpack(data)
    if not all(map(math.isfinite, numbers)):
        raise BadFrame("malformed", "a pose that is not finite")
    return Pose(*numbers), utc_ns
