"""A robot's pose as trackers publish it: 32 bytes under the robot's key, `SwarmKeys.pose`."""

import math
import struct
from typing import NamedTuple

from swarmwire.comms.errors import BadFrame

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
