"""Wheel travel becomes a pose and comes back as wheel travel."""

from math import nan, pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarmwire.comms.errors import BadFrame
from swarmwire.comms.robots.ros2.kinds import ODOMETRY
from swarmwire.comms.robots.ros2.messages import Messages
from swarmwire.comms.robots.ros2.wheel_poses import WheelPoses
from swarmwire.comms.robots.ros2.wheel_travel import WheelTravel
from tests.support.comms.robots.ros2 import independent
from tests.support.comms.robots.ros2.independent import Quaternion, odometry

MESSAGES = Messages("jazzy")
BASE_M, MAX_MPS = 0.16, 0.22
TICK_NS = 100_000_000


def followed(travel: WheelTravel, message: independent.Odometry) -> tuple[float, float]:
    travel.follow(MESSAGES.decode(ODOMETRY, message.serialize()))
    return travel.left_m, travel.right_m


def turned(yaw_rad: float) -> Quaternion:
    return Quaternion(z=float(np.sin(yaw_rad / 2)), w=float(np.cos(yaw_rad / 2)))


STEPS = st.lists(st.tuples(st.floats(-0.03, 0.03), st.floats(-0.03, 0.03)), min_size=1, max_size=60)


@settings(max_examples=60, deadline=None)
@given(STEPS)
def test_travel_of_wheels_goes_out_as_a_pose_and_comes_back_as_it_was(steps):
    poses, travel = WheelPoses(1, BASE_M), WheelTravel(BASE_M, MAX_MPS)
    rolled_m, theirs = np.zeros(2), odometry(0.0, 0.0, Quaternion(), 0)
    for tick, step in enumerate([(0.0, 0.0), *steps]):
        rolled_m = rolled_m + step
        poses.follow(tick * TICK_NS, rolled_m[:1], rolled_m[1:])
        theirs = independent.Odometry.deserialize(MESSAGES.encode(ODOMETRY, poses.message(MESSAGES, 0, tick * TICK_NS)))
        assert followed(travel, theirs) == pytest.approx(tuple(rolled_m), abs=1e-9)
    assert theirs.twist.twist.linear.x == pytest.approx(sum(steps[-1]) / 2 / 0.1, abs=1e-9)
    assert theirs.twist.twist.angular.z == pytest.approx((steps[-1][1] - steps[-1][0]) / BASE_M / 0.1, abs=1e-9)
    assert travel.jumps == 0


def test_many_turns_on_the_spot_add_up_across_the_seam_of_the_yaw():
    travel = WheelTravel(BASE_M, MAX_MPS)
    for tick in range(101):
        followed(travel, odometry(0.0, 0.0, turned(tick * 0.2 * pi), tick * TICK_NS))
    assert (travel.left_m, travel.right_m) == pytest.approx((-20 * pi * BASE_M / 2, 20 * pi * BASE_M / 2))


def test_backwards_is_negative_whatever_the_heading():
    travel = WheelTravel(BASE_M, MAX_MPS)
    followed(travel, odometry(0.0, 0.0, turned(3.0), 0))
    back = -0.02
    told = followed(travel, odometry(back * np.cos(3.0), back * np.sin(3.0), turned(3.0), TICK_NS))
    assert told == pytest.approx((back, back))


def test_a_pose_that_jumps_is_counted_and_no_travel():
    travel = WheelTravel(BASE_M, MAX_MPS)
    followed(travel, odometry(5.0, 5.0, turned(0.0), 0))
    assert followed(travel, odometry(0.0, 0.0, turned(0.0), TICK_NS)) == (0.0, 0.0)  # it was switched on anew
    assert travel.jumps == 1
    assert followed(travel, odometry(0.02, 0.0, turned(0.0), 2 * TICK_NS)) == pytest.approx((0.02, 0.02))


@pytest.mark.parametrize("pose", [(nan, 0.0, turned(0.0)), (0.0, nan, turned(0.0)), (0.0, 0.0, Quaternion(w=0.0))])
def test_a_pose_that_is_none_is_a_bad_frame_and_changes_nothing(pose):
    travel = WheelTravel(BASE_M, MAX_MPS)
    followed(travel, odometry(0.0, 0.0, turned(0.0), 0))
    with pytest.raises(BadFrame):
        followed(travel, odometry(*pose, TICK_NS))
    assert followed(travel, odometry(0.01, 0.0, turned(0.0), 2 * TICK_NS)) == pytest.approx((0.01, 0.01))


def test_travel_that_was_not_told_for_a_while_is_added_when_it_is():
    poses = WheelPoses(2, BASE_M)
    for tick, left_m in enumerate(([0.0, nan], [0.1, nan], [nan, 0.2], [0.3, 0.3])):
        poses.follow(tick * TICK_NS, np.array(left_m), np.array(left_m))
    assert poses.pose == pytest.approx(np.array([[0.3, 0.0, 0.0], [0.3, 0.0, 0.0]]))
