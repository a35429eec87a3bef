"""Every frame is the one that an independent library makes and reads."""

from dataclasses import fields, is_dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pycdr2._support import Endianness

from swarmwire.comms.bodies.body import load_body
from swarmwire.comms.errors import BadFrame
from swarmwire.comms.robots.ros2 import keys, messages
from swarmwire.comms.robots.ros2.laser import laser_scan
from swarmwire.comms.robots.ros2.messages import Messages, stamp_ns
from swarmwire.comms.robots.ros2.motion import Motion, WheelPoses, imu
from swarmwire.comms.robots.ros2.other_sensors import battery_state, illuminance
from tests.support.comms.robots.ros2 import independent

MESSAGES = Messages("jazzy")
SINGLES = st.floats(width=32, allow_nan=True)
DOUBLES = st.floats(allow_nan=True)
FINITE = st.floats(allow_nan=False, allow_infinity=False)
STAMPS = st.integers(0, 2**31 * 10**9 - 1)
FRAMES = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=20)


def headers():
    return st.builds(independent.header, STAMPS, FRAMES)


def vectors():
    return st.builds(independent.Vector3, DOUBLES, DOUBLES, DOUBLES)


def twists():
    return st.builds(independent.Twist, vectors(), vectors())


def numbers(count: int):
    return st.lists(DOUBLES, min_size=count, max_size=count)


def quaternions():
    return st.builds(independent.Quaternion, DOUBLES, DOUBLES, DOUBLES, DOUBLES)


def singles(most: int = 40):
    return st.lists(SINGLES, max_size=most)


POSES = st.builds(independent.PoseWithCovariance, st.builds(independent.Pose, vectors(), quaternions()), numbers(36))
SAMPLES = {
    keys.TWIST: twists(),
    keys.TWIST_STAMPED: st.builds(independent.TwistStamped, headers(), twists()),
    keys.LASER_SCAN: st.builds(independent.LaserScan, headers(), *[SINGLES] * 7, singles(), singles()),
    keys.ODOMETRY: st.builds(
        independent.Odometry,
        headers(),
        FRAMES,
        POSES,
        st.builds(independent.TwistWithCovariance, twists(), numbers(36)),
    ),
    keys.IMU: st.builds(
        independent.Imu, headers(), quaternions(), numbers(9), vectors(), numbers(9), vectors(), numbers(9)
    ),
    keys.BATTERY_STATE: st.builds(
        independent.BatteryState,
        headers(),
        *[SINGLES] * 7,
        *[st.integers(0, 255)] * 3,
        st.booleans(),
        singles(4),
        singles(4),
        FRAMES,
        FRAMES,
    ),
    keys.ILLUMINANCE: st.builds(independent.Illuminance, headers(), DOUBLES, DOUBLES),
    keys.CLOCK: st.builds(independent.Clock, st.builds(independent.Time, st.integers(0, 2**31 - 1), st.just(5))),
}


def same(one, other) -> bool:
    """Whether two messages say the same, of whichever library each is."""
    if is_dataclass(one):
        return all(same(getattr(one, of.name), getattr(other, of.name)) for of in fields(one))
    if isinstance(one, str):
        return one == other
    return np.array_equal(np.asarray(one, np.float64), np.asarray(other, np.float64), equal_nan=True)


@pytest.mark.parametrize("kind", SAMPLES)
@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_what_the_other_library_writes_we_read_and_write_as_it_does(kind, data):
    theirs = data.draw(SAMPLES[kind])
    frame = theirs.serialize()
    ours = MESSAGES.decode(kind, frame)
    assert same(theirs, ours)
    assert same(independent.BY_KIND[kind].deserialize(MESSAGES.encode(kind, ours)), ours)


@pytest.mark.parametrize("kind", SAMPLES)
@settings(max_examples=15, deadline=None)
@given(data=st.data())
def test_half_a_message_is_a_bad_frame(kind, data):
    frame = data.draw(SAMPLES[kind]).serialize()
    half = frame[: data.draw(st.integers(0, len(frame) - 5))]
    with pytest.raises(BadFrame, match="malformed"):
        MESSAGES.decode(kind, half)


@given(linear=FINITE, angular=FINITE, lateral=FINITE, stamp=STAMPS, frame=FRAMES)
def test_commands_laid_out_by_hand_are_those_of_the_library(linear, angular, lateral, stamp, frame):
    told, theirs = messages.Velocities(linear, angular, lateral), independent.twist(linear, angular, lateral)
    assert messages.encode_twist(told) == theirs.serialize()
    assert len(theirs.serialize()) == 52
    stamped = independent.TwistStamped(independent.header(stamp, frame), theirs).serialize()
    assert messages.encode_twist_stamped(told, stamp, frame) == stamped
    assert messages.decode_twist(theirs.serialize()) == told
    for frame_bytes in (theirs.serialize(), stamped):
        assert messages.decode_either(frame_bytes) == told


@settings(max_examples=25, deadline=None)
@given(linear=FINITE, angular=FINITE, frame=FRAMES)
def test_commands_of_the_other_endianness_mean_the_same(linear, angular, frame):
    message = independent.TwistStamped(independent.header(5, frame), independent.twist(linear, angular))
    assert messages.decode_either(message.serialize(endianness=Endianness.Big)) == messages.Velocities(linear, angular)
    plain = message.twist.serialize(endianness=Endianness.Big)
    assert messages.decode_either(plain) == messages.Velocities(linear, angular)


@pytest.mark.parametrize("broken", [float("nan"), float("inf"), float("-inf")])
def test_a_velocity_that_is_not_finite_is_refused(broken):
    with pytest.raises(BadFrame):
        messages.decode_either(independent.twist(0.1, broken).serialize())


@given(st.binary(max_size=120))
def test_garbage_is_refused_or_commands_something_finite(payload):
    try:
        told = messages.decode_either(payload)
    except BadFrame:
        return
    assert np.all(np.isfinite(told))


def made() -> dict[str, object]:
    """A message of each kind that a gateway sends, made from readings."""
    scan = load_body("turtlebot3-burger").scan
    assert scan is not None
    poses = WheelPoses(2, 0.16)
    poses.follow(0, np.zeros(2), np.zeros(2))
    poses.follow(100_000_000, np.array([0.0, 0.1]), np.array([0.0, 0.2]))
    return {
        keys.LASER_SCAN: laser_scan(MESSAGES, scan, np.full(360, np.inf), 3),
        keys.ODOMETRY: poses.message(MESSAGES, 1, 3),
        keys.IMU: imu(MESSAGES, Motion(1.0, 2.0, 3.0, 0.5), 0.0, 3),
        keys.BATTERY_STATE: battery_state(MESSAGES, 0.5, 11.0, 3),
        keys.ILLUMINANCE: illuminance(MESSAGES, 0.5, 800.0, "cell", 3),
        keys.CLOCK: MESSAGES.make(keys.CLOCK, MESSAGES.time(3)),
    }


@pytest.mark.parametrize("kind", made())
def test_what_a_gateway_sends_the_other_library_reads_and_writes_to_the_byte(kind):
    frame = MESSAGES.encode(kind, made()[kind])
    theirs = independent.BY_KIND[kind].deserialize(frame)
    assert same(theirs, MESSAGES.decode(kind, frame))
    assert theirs.serialize() == frame


def test_a_stamp_is_the_time_that_it_was_made_from():
    assert stamp_ns(MESSAGES.header(1_700_000_000_123_456_789, "f")) == 1_700_000_000_123_456_789
