"""Wheel travel, Imu, BatteryState and Illuminance mean what their definitions say, each way and back."""

# pyright: reportIndexIssue=false
from math import isnan, nan, pi, radians

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.bodies.body import load_body
from swarmwire.comms.errors import BadFrame
from swarmwire.comms.robots.ros2.keys import BATTERY_STATE, ILLUMINANCE, IMU, ODOMETRY
from swarmwire.comms.robots.ros2.messages import Messages
from swarmwire.comms.robots.ros2.motion import Motion, WheelPoses, WheelTravel, imu, motion_of
from swarmwire.comms.robots.ros2.other_sensors import (
    battery_state,
    brightness_of,
    charge_of,
    illuminance,
    topics_of_light,
)
from swarmwire.comms.sensors.simple import BatterySpec
from tests.support.comms.robots.ros2 import independent
from tests.support.comms.robots.ros2.independent import Quaternion, Vector3, odometry

MESSAGES = Messages("jazzy")
BASE_M, MAX_MPS = 0.16, 0.22
TICK_NS = 100_000_000


def followed(travel: WheelTravel, message: independent.Odometry) -> tuple[float, float]:
    travel.follow(MESSAGES.decode(ODOMETRY, message.serialize()))
    return travel.left_m, travel.right_m


def turned(yaw_rad: float) -> Quaternion:
    return Quaternion(z=float(np.sin(yaw_rad / 2)), w=float(np.cos(yaw_rad / 2)))


STEPS = st.lists(st.tuples(st.floats(-0.03, 0.03), st.floats(-0.03, 0.03)), min_size=1, max_size=60)


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


SOME = st.floats(-5.0, 5.0)


def sent(kind, message):
    return independent.BY_KIND[kind].deserialize(MESSAGES.encode(kind, message))


def received(kind, message):
    return MESSAGES.decode(kind, message.serialize())


@given(SOME, SOME, SOME, st.floats(-3.1, 3.1), st.floats(-360.0, 360.0))
def test_a_motion_goes_out_as_imu_and_comes_back_as_it_was(forward, left, turn, heading, north_deg):
    theirs = sent(IMU, imu(MESSAGES, Motion(forward, left, turn, heading), north_deg, 0))
    assert theirs.linear_acceleration.z == pytest.approx(9.80665)
    back = motion_of(received(IMU, theirs), north_deg)
    assert back[:3] == (forward, left, turn)
    assert back.heading_rad == pytest.approx(heading, abs=1e-9)


def test_x_is_ahead_y_to_the_left_and_the_yaw_turns_counter_clockwise():
    zeros = [0.0] * 9
    quarter = Quaternion(z=2**-0.5, w=2**-0.5)
    message = independent.Imu(
        independent.header(), quarter, zeros, Vector3(0.1, 0.2, 0.3), zeros, Vector3(1.0, 2.0, 9.8), zeros
    )
    assert motion_of(received(IMU, message), 0.0) == pytest.approx((1.0, 2.0, 0.3, pi / 2))
    assert motion_of(received(IMU, message), 90.0).heading_rad == pytest.approx(pi)
    assert motion_of(received(IMU, message), 100.0).heading_rad == pytest.approx(radians(-170.0))


def test_what_is_not_measured_is_told_as_such_and_read_as_nan():
    for known in range(3):
        motion = Motion(*(1.0 if known == 0 else nan,) * 2, 2.0 if known == 1 else nan, 0.5 if known == 2 else nan)
        theirs = sent(IMU, imu(MESSAGES, motion, 0.0, 0))
        first = (
            theirs.linear_acceleration_covariance[0],
            theirs.angular_velocity_covariance[0],
            theirs.orientation_covariance[0],
        )
        assert [value == -1.0 for value in first] == [known != 0, known != 1, known != 2]
        assert motion_of(received(IMU, theirs), 0.0) == pytest.approx(motion, nan_ok=True)


def battery() -> BatterySpec:
    spec = load_body("turtlebot3-burger").sensors["battery"]
    assert isinstance(spec, BatterySpec)
    return spec


@pytest.mark.parametrize(
    ("percentage", "voltage_v", "charge"),
    [(0.4, 11.0, 0.4), (nan, 9.9, 0.0), (nan, 12.6, 1.0), (nan, 11.25, 0.5), (40.0, 11.25, 0.5), (nan, 14.0, 1.0)],
)
def test_the_charge_is_the_share_that_is_told_else_what_the_voltage_says(percentage, voltage_v, charge):
    theirs = sent(BATTERY_STATE, battery_state(MESSAGES, percentage, voltage_v, 0))
    assert (theirs.percentage, theirs.voltage) == pytest.approx((percentage, voltage_v), nan_ok=True)
    assert theirs.present
    assert charge_of(received(BATTERY_STATE, theirs), battery()) == pytest.approx(charge, abs=1e-6)


def test_a_battery_that_tells_nothing_has_no_charge():
    theirs = sent(BATTERY_STATE, battery_state(MESSAGES, nan, nan, 0))
    assert isnan(charge_of(received(BATTERY_STATE, theirs), battery()))


@pytest.mark.parametrize(
    ("lux", "value"), [(0.0, 0.0), (400.0, 0.5), (800.0, 1.0), (9e9, 1.0), (-1.0, 0.0), (nan, 0.0)]
)
def test_illuminance_is_light_that_reads_1_at_full_lux(lux, value):
    message = independent.Illuminance(independent.header(), lux, 0.0)
    assert brightness_of(received(ILLUMINANCE, message), 800.0) == value


def test_light_goes_out_in_lux():
    assert sent(ILLUMINANCE, illuminance(MESSAGES, 0.25, 800.0, "cell", 0)).illuminance == 200.0
    assert topics_of_light("illuminance", 3) == ("illuminance_0", "illuminance_1", "illuminance_2")
