"""Imu, BatteryState and Illuminance mean what their definitions say."""

# pycdr2 has arrays for types that are lists in fact:
# pyright: reportIndexIssue=false

from math import isnan, nan, pi, radians

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.bodies.body import load_body
from swarmwire.comms.robots.ros2.battery_state import battery_state, charge_of
from swarmwire.comms.robots.ros2.illuminance import brightness_of, illuminance, topics_of_light
from swarmwire.comms.robots.ros2.inertial import Motion, imu, motion_of
from swarmwire.comms.robots.ros2.kinds import BATTERY_STATE, ILLUMINANCE, IMU
from swarmwire.comms.robots.ros2.messages import Messages
from swarmwire.comms.sheets import Battery
from tests.support.comms.robots.ros2 import independent
from tests.support.comms.robots.ros2.independent import Quaternion, Vector3

MESSAGES = Messages("jazzy")
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


def battery() -> Battery:
    sheet = load_body("turtlebot3-burger").senses["battery"]
    assert isinstance(sheet, Battery)
    return sheet


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
