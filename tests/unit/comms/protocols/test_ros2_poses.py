"""Poses in messages of ROS 2."""

from math import atan2, cos, inf, isnan, nan, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.base.errors import BadFrame
from swarmwire.comms.protocols.ros2.keys import ODOMETRY, POSE_STAMPED, TRANSFORMS
from swarmwire.comms.protocols.ros2.messages import Messages, stamp_ns
from swarmwire.comms.protocols.ros2.poses import poses_of, space_pose
from tests.support.comms.protocols.ros2 import independent

ANGLES = st.floats(-3.1, 3.1)
MESSAGES = Messages("jazzy")
LEVEL = independent.Quaternion(0.0, 0.0, sin(0.25), cos(0.25))


def quaternion_of(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """Quaternion x, y, z, w of turns about the fixed axes x, then y, then z, by Hamilton's product."""

    def product(p: np.ndarray, q: np.ndarray) -> np.ndarray:
        vector = p[3] * q[:3] + q[3] * p[:3] + np.cross(p[:3], q[:3])
        return np.append(vector, p[3] * q[3] - p[:3] @ q[:3])

    turns = [np.append(sin(a / 2) * np.eye(3)[k], cos(a / 2)) for k, a in enumerate((roll, pitch, yaw))]
    return product(turns[2], product(turns[1], turns[0]))


@given(roll=ANGLES, pitch=st.floats(-1.5, 1.5), yaw=ANGLES, length=st.floats(0.1, 10.0))
def test_heading_is_the_yaw_of_roll_pitch_and_yaw_for_any_length_of_the_quaternion(roll, pitch, yaw, length):
    orientation = independent.Quaternion(*map(float, length * quaternion_of(roll, pitch, yaw)))
    heading_rad = space_pose(independent.Point(1.0, 2.0, 3.0), orientation).heading_rad
    assert abs(atan2(sin(heading_rad - yaw), cos(heading_rad - yaw))) < 1e-6


def test_quaternion_of_length_zero_gives_a_position_without_heading():
    pose = space_pose(independent.Point(1.0, 2.0, 3.0), independent.Quaternion(0.0, 0.0, 0.0, 0.0))
    assert pose[:3] == (1.0, 2.0, 3.0)
    assert isnan(pose.heading_rad)


@pytest.mark.parametrize("value", [nan, inf, -inf])
@pytest.mark.parametrize("axis", range(7))
def test_pose_that_is_not_finite_is_malformed(axis, value):
    values = [0.0] * 6 + [1.0]
    values[axis] = value
    with pytest.raises(BadFrame, match="malformed"):
        space_pose(independent.Point(*values[:3]), independent.Quaternion(*values[3:]))


def test_poses_of_a_tf_message_are_named_by_parent_and_frame():
    def stamped(parent: str, frame: str, x_m: float) -> independent.TransformStamped:
        transform = independent.Transform(independent.Vector3(x_m, 0.0, 0.5), LEVEL)
        return independent.TransformStamped(independent.header(5, parent), frame, transform)

    transforms = [stamped("map", "a", 1.0), stamped("odom", "b", 2.0), stamped("/map", "/c", 3.0)]
    message = MESSAGES.decode(TRANSFORMS, independent.TFMessage(transforms).serialize())
    positions = {pose.name: space_pose(pose.position, pose.orientation) for pose in poses_of(TRANSFORMS, message)}
    assert positions["map a"] == pytest.approx((1.0, 0.0, 0.5, 0.5))
    assert {name: pose.x_m for name, pose in positions.items()} == {"map a": 1.0, "odom b": 2.0, "map c": 3.0}
    assert {stamp_ns(pose.header) for pose in poses_of(TRANSFORMS, message)} == {5}


def test_poses_of_odometry_and_pose_stamped_are_one_each():
    pose = independent.Pose(independent.Point(1.0, 2.0, 3.0), LEVEL)
    posed = independent.PoseWithCovariance(pose, [0.0] * 36)
    still = independent.TwistWithCovariance(independent.Twist(), [0.0] * 36)
    sent = {
        ODOMETRY: independent.Odometry(independent.header(5, "odom"), "base", posed, still),
        POSE_STAMPED: independent.PoseStamped(independent.header(5, "map"), pose),
    }
    for kind, message in sent.items():
        [message_pose] = poses_of(kind, MESSAGES.decode(kind, message.serialize()))
        assert (message_pose.name, stamp_ns(message_pose.header)) == ("", 5)
        assert space_pose(message_pose.position, message_pose.orientation) == pytest.approx((1.0, 2.0, 3.0, 0.5))


def test_frame_whose_name_is_no_text_is_malformed():
    pose = independent.Pose(independent.Point(), independent.Quaternion())
    payload = bytearray(independent.PoseStamped(independent.header(5, "map"), pose).serialize())
    payload[payload.index(b"map")] = 0xFF
    with pytest.raises(BadFrame, match="malformed"):
        MESSAGES.decode(POSE_STAMPED, bytes(payload))
