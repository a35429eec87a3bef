"""Imu messages: accelerations, turn rate and heading of a base on a level floor."""

from math import isnan, nan, radians
from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms.robots.ros2.kinds import IMU
from swarmwire.comms.robots.ros2.messages import Messages
from swarmwire.comms.robots.ros2.yaw import quaternion, within_turn, yaw_of

FRAME = "imu_link"
GRAVITY_MPS2 = 9.80665  # what an accelerometer at rest feels upwards


class Motion(NamedTuple):
    """What an Imu message says, in the frame of the base; nan: it does not tell."""

    forward_mps2: float = nan
    left_mps2: float = nan
    turn_radps: float = nan
    heading_rad: float = nan  # in (-pi, pi]


def motion_of(message: Any, north_deg: float) -> Motion:
    """What a message says; the heading is its yaw turned by `north_deg`.

    Orientation, turn rate or acceleration whose first covariance is -1 it does not tell (its definition says so).
    """
    turn, acceleration = message.angular_velocity, message.linear_acceleration
    told = message.linear_acceleration_covariance[0] != -1.0
    yaw_rad = yaw_of(message.orientation) if message.orientation_covariance[0] != -1.0 else nan
    return Motion(
        acceleration.x if told else nan,
        acceleration.y if told else nan,
        turn.z if message.angular_velocity_covariance[0] != -1.0 else nan,
        within_turn(yaw_rad + radians(north_deg)) if not isnan(yaw_rad) else nan,
    )


def imu(messages: Messages, motion: Motion, north_deg: float, stamp_ns: int) -> Any:
    """The message of a motion; what is nan it does not tell."""
    make = messages.make
    known = not isnan(motion.forward_mps2 + motion.left_mps2)
    turn_radps, heading_rad = motion.turn_radps, motion.heading_rad
    yaw_rad = 0.0 if isnan(heading_rad) else within_turn(heading_rad - radians(north_deg))
    forward_mps2, left_mps2 = (motion.forward_mps2, motion.left_mps2) if known else (0.0, 0.0)
    return make(
        IMU,
        messages.header(stamp_ns, FRAME),
        quaternion(messages, yaw_rad),
        _covariance(told=not isnan(heading_rad)),
        make("geometry_msgs/msg/Vector3", 0.0, 0.0, 0.0 if isnan(turn_radps) else turn_radps),
        _covariance(told=not isnan(turn_radps)),
        make("geometry_msgs/msg/Vector3", forward_mps2, left_mps2, GRAVITY_MPS2),
        _covariance(told=known),
    )


def _covariance(told: bool) -> Any:
    """Zeros: not known; its first element -1: there is no such measurement."""
    covariance = np.zeros(9)
    covariance[0] = 0.0 if told else -1.0
    return covariance
