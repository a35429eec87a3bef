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


class MessagePose(NamedTuple):
    """A pose as a message holds it."""

    name: str
    header: Any
    position: Any
    orientation: Any


def transform_name(parent: str, frame: str) -> str:
    """Return the name of a frame's pose in its parent; a first slash is ignored, as in tf2 (buffer_core.cpp).

    >>> transform_name("map", "/robot1/base_link")
    'map robot1/base_link'
    """
    return f"{parent.removeprefix('/')} {frame.removeprefix('/')}"


def poses_of(kind: str, message: Any) -> Iterator[MessagePose]:
    """Yield the poses in a message: `ONLY` one, or that of each transform."""
    if kind == TRANSFORMS:
        for stamped in message.transforms:
            name, transform = transform_name(stamped.header.frame_id, stamped.child_frame_id), stamped.transform
            yield MessagePose(name, stamped.header, transform.translation, transform.rotation)
    else:
        pose = message.pose.pose if kind == ODOMETRY else message.pose
        yield MessagePose(ONLY, message.header, pose.position, pose.orientation)


def space_pose(position: Any, orientation: Any) -> SpacePose:
    """Return the pose of a position and a quaternion; BadFrame unless all their numbers are finite.

    A quaternion of length 0 gives no heading.
    """
    values = (position.x, position.y, position.z, orientation.x, orientation.y, orientation.z, orientation.w)
    if not all(map(isfinite, values)):
        raise BadFrame("malformed", "a pose that is not finite")
    return SpacePose(position.x, position.y, position.z, yaw_of(orientation))
