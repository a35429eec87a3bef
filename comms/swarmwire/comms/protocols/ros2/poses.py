"""Poses of robots in messages of others: Odometry, PoseStamped, and the transforms of a TFMessage."""

from collections.abc import Iterator
from math import isfinite
from typing import Any, NamedTuple

from swarmwire.comms.base.errors import BadFrame
from swarmwire.comms.protocols.ros2.keys import ODOMETRY, TRANSFORMS
from swarmwire.comms.protocols.ros2.motion import yaw_of

ONLY = ""  # name of the one pose in an Odometry or PoseStamped


class SpacePose(NamedTuple):
    """Position and heading of a robot."""

    x_m: float
    y_m: float
    z_m: float
    heading_rad: float  # nan: not given


def poses_of(kind: str, message: Any, parent: str) -> Iterator[tuple[str, Any, Any]]:
    """Yield the name, position and orientation of each pose in a message.

    A transform counts if its parent frame is `parent`; its name is its own frame. Other messages hold `ONLY` one pose.
    A first slash of a frame is ignored, as tf2 does (tf2: buffer_core.cpp, setTransform).
    """
    if kind == TRANSFORMS:
        for stamped in message.transforms:
            if stamped.header.frame_id.removeprefix("/") == parent.removeprefix("/"):
                frame, transform = stamped.child_frame_id.removeprefix("/"), stamped.transform
                yield frame, transform.translation, transform.rotation
    else:
        pose = message.pose.pose if kind == ODOMETRY else message.pose
        yield ONLY, pose.position, pose.orientation


def space_pose(position: Any, orientation: Any) -> SpacePose:
    """Return the pose of a position and a quaternion; BadFrame unless all their numbers are finite.

    A quaternion of length 0 gives no heading.
    """
    values = (position.x, position.y, position.z, orientation.x, orientation.y, orientation.z, orientation.w)
    if not all(map(isfinite, values)):
        raise BadFrame("malformed", "a pose that is not finite")
    return SpacePose(position.x, position.y, position.z, yaw_of(orientation))
