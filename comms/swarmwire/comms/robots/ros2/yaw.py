"""Turns about the vertical as ROS's quaternions have them."""

from math import atan2, cos, pi, remainder, sin
from typing import Any

from swarmwire.comms.robots.ros2.messages import Messages


def yaw_of(quaternion: Any) -> float:
    """The turn about the vertical of a quaternion, in rad, in [-pi, pi]; nan if it is none."""
    x, y, z, w = quaternion.x, quaternion.y, quaternion.z, quaternion.w
    if not x * x + y * y + z * z + w * w > 0.0:
        return float("nan")
    return atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)


def quaternion(messages: Messages, yaw_rad: float) -> Any:
    """The quaternion of a turn about the vertical."""
    return messages.make("geometry_msgs/msg/Quaternion", 0.0, 0.0, sin(0.5 * yaw_rad), cos(0.5 * yaw_rad))


def within_turn(angle_rad: float) -> float:
    """This angle in (-pi, pi]."""
    wrapped = remainder(angle_rad, 2.0 * pi)
    return pi if wrapped == -pi else wrapped
