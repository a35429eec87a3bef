"""Keys and messages of ROS 2 in zenoh."""

import struct
from dataclasses import fields, is_dataclass

import numpy as np
import pytest
import zenoh
from hypothesis import given, settings
from hypothesis import strategies as st
from pycdr2._support import Endianness
from zenoh.ext import Int64, z_deserialize, z_serialize

from swarmwire.comms.base.errors import BadFrame, BadInput
from swarmwire.comms.protocols.ros2 import keys, messages, readings
from swarmwire.comms.protocols.ros2.laser import laser_scan
from swarmwire.comms.protocols.ros2.messages import Messages
from swarmwire.comms.protocols.ros2.motion import Motion, WheelPoses, imu, joint_state
from swarmwire.comms.protocols.ros2.readings import battery_state, illuminance
from swarmwire.comms.robot.bodies.body import load_body
from swarmwire.comms.robot.bodies.ros2_names import DEFAULT_NAMES
from swarmwire.comms.robot.sensors.simple import OdometrySpec
from tests.support.comms.protocols.ros2 import independent
from tests.support.comms.protocols.ros2.type_hashes import rihs01

# As `ros2 topic info -v` and rmw_zenoh's design page show them.
HASHES = {
    keys.TWIST: "RIHS01_9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a",
    keys.TWIST_STAMPED: "RIHS01_5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64",
    keys.LASER_SCAN: "RIHS01_64c191398013af96509d518dac71d5164f9382553fce5c1f8cca5be7924bd828",
    keys.ODOMETRY: "RIHS01_3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0",
    keys.IMU: "RIHS01_7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b",
    keys.BATTERY_STATE: "RIHS01_4bee5dfce981c98faa6828b868307a0a73f992ed0789f374ee96c8f840e69741",
    keys.POSE_STAMPED: "RIHS01_10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8",
    keys.TRANSFORMS: "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
}
LONGEST = 2**63 - 1
MESSAGES = Messages("jazzy")
SINGLES = st.floats(width=32, allow_nan=True)
DOUBLES = st.floats(allow_nan=True)
FINITE = st.floats(allow_nan=False, allow_infinity=False)
SHADE = np.array([0.0, 1.0, 0.5, 0.05])
STAMPS = st.integers(0, 2**31 * 10**9 - 1)
FRAMES = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=20)


@pytest.mark.parametrize("distro", ["iron", "jazzy", "kilted"])
@pytest.mark.parametrize("kind", HASHES)
def test_type_hashes_match_ros(distro, kind):
    assert Messages(distro).hash_of(kind) == HASHES[kind]


@pytest.mark.parametrize("kind", independent.KINDS, ids=lambda kind: kind.__name__)
def test_type_hashes_match_rep_2016(kind):
    assert MESSAGES.hash_of(kind.__idl_typename__) == rihs01(kind)


def test_type_hash_of_string_matches_the_design_page_and_humble_has_none():
    assert MESSAGES.hash_of("std_msgs/msg/String").startswith("RIHS01_df668c740482bbd48fb39d76a70dfd4b")
    assert Messages("humble").hash_of(keys.TWIST) == "TypeHashNotSupported"


def test_rmw_keys_have_domain_name_type_and_hash():
    key = keys.rmw_key(0, "/cmd_vel", keys.TWIST, HASHES[keys.TWIST])
    assert key == f"0/cmd_vel/geometry_msgs::msg::dds_::Twist_/{HASHES[keys.TWIST]}"
    assert zenoh.KeyExpr(keys.rmw_key(0, "/cmd_vel", keys.TWIST)).includes(zenoh.KeyExpr(key))
    assert not zenoh.KeyExpr(keys.rmw_key(0, "/cmd_vel", keys.TWIST_STAMPED)).includes(zenoh.KeyExpr(key))


def test_rmw_tokens_match_the_design_page():
    node = keys.RmwNode(2, "aa11", 1, "/flock_0", "base")
    assert node.token == "@ros2_lv/2/aa11/10000/10000/NN/%/%flock_0/base"
    assert node.topic_token(3, "MP", "/flock_0/scan", keys.LASER_SCAN, "RIHS01_64") == (
        "@ros2_lv/2/aa11/10000/10003/MP/%/%flock_0/base/%flock_0%scan/"
        "sensor_msgs::msg::dds_::LaserScan_/RIHS01_64/::,10:,:,:,,"
    )
    assert keys.RmwNode(0, "aa11", 0, "/", "base").token == "@ros2_lv/0/aa11/0/0/NN/%/%/base"
    for token in (node.token, node.topic_token(3, "MP", "/flock_0/scan", keys.LASER_SCAN, "RIHS01_64")):
        assert zenoh.KeyExpr("@ros2_lv/2/**").includes(zenoh.KeyExpr(token))


@pytest.mark.parametrize(
    ("qos", "in_rmw", "in_bridge"),
    [
        (keys.Qos(), "//::,10:,:,:,,", "/:1:0:0,10:"),
        (keys.Qos(depth=100), "//::,100:,:,:,,", "/:1:0:0,100:"),
        (keys.Qos(depth=42), "//::,:,:,:,,", "/:1:0:0,42:"),  # rmw_zenoh leaves out its own defaults
        (keys.Qos(depth=1, latched=True), "//:1:,1:,:,:,,", "/:1:1:0,1:"),
    ],
)
def test_tokens_carry_depth_and_durability(qos, in_rmw, in_bridge):
    topic = "/flock_0/tf_static", keys.TRANSFORMS, ""
    assert keys.RmwNode(0, "aa11", 0, "/flock_0", "base").topic_token(1, "MP", *topic, qos).endswith(in_rmw)
    assert in_bridge in keys.bridge_token("aa11", keys.WRITE, *topic, qos)


def test_publisher_id_is_the_xxh3_of_its_token():
    """xxHash's own test vector of no bytes, as XXH3_128bits returns its halves."""
    assert keys.publisher_id("") == struct.pack("<QQ", 0x6001C324468D497F, 0x99AA06D3014798D8)


def test_bridge_tokens_match_its_source():
    token = keys.bridge_token("aa11", keys.WRITE, "/flock_0/scan", keys.LASER_SCAN, "RIHS01_64")
    assert keys.bridge_token("aa11", keys.READ, "/flock_0/cmd_vel", keys.TWIST, "").startswith("@/aa11/@ros2_lv/MS/")
    assert token == ("@/aa11/@ros2_lv/MP/flock_0§scan/sensor_msgs§msg§LaserScan/:1:0:0,10:typehash=RIHS01_64;")
    assert zenoh.KeyExpr("@/*/@ros2_lv/**").includes(zenoh.KeyExpr(token))
    assert zenoh.KeyExpr("@/*/@ros2_lv/**").includes(zenoh.KeyExpr(keys.bridge_itself("aa11")))


@given(st.integers(0, LONGEST), st.integers(0, LONGEST), st.text(max_size=30))
def test_attachment_matches_zenoh_serialization(sequence, utc_ns, token):
    attached = keys.attachment(sequence, utc_ns, keys.publisher_id(token))
    assert len(attached) == 33
    values = (Int64(sequence), Int64(utc_ns), keys.publisher_id(token))
    assert bytes(z_serialize(values)) == attached
    assert z_deserialize(tuple[Int64, Int64, bytes], zenoh.ZBytes(attached)) == values
    keys.check_attachment(attached)


@pytest.mark.parametrize(
    "attached", [None, b"", bytes(33), bytes(32), keys.attachment(1, 2, keys.publisher_id("")) + b"0"]
)
def test_message_without_a_proper_attachment_is_refused(attached):
    with pytest.raises(BadFrame, match="no_attachment"):
        keys.check_attachment(attached)


@given(st.from_regex(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,20}", fullmatch=True))
def test_ros_name_is_valid_for_any_robot(robot):
    assert keys.NAME.fullmatch(keys.ros_name(robot))


@pytest.mark.parametrize("name", ["", "7up", "a b", "a//b", "a/", "a__b", "flock-0", "~/scan"])
def test_invalid_ros_name_is_refused(name):
    with pytest.raises(BadInput, match="driver: scan_topic: expected a ROS name"):
        keys.check_name(name, "driver", "scan_topic")


def test_missing_rosbags_names_the_pip_command(monkeypatch):
    monkeypatch.setattr("swarmwire.comms.base.extras.find_spec", lambda _: None)
    with pytest.raises(BadInput, match=r"install swarmwire-agent\[ros2\]"):
        Messages("jazzy")


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


POSE = st.builds(independent.Pose, vectors(), quaternions())
POSES = st.builds(independent.PoseWithCovariance, POSE, numbers(36))
TRANSFORM = st.builds(independent.Transform, vectors(), quaternions())
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
    keys.POSE_STAMPED: st.builds(independent.PoseStamped, headers(), POSE),
    keys.TRANSFORMS: st.builds(
        independent.TFMessage,
        st.lists(st.builds(independent.TransformStamped, headers(), FRAMES, TRANSFORM), max_size=4),
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
    keys.RANGE: st.builds(independent.Range, headers(), st.integers(0, 255), *[SINGLES] * 5),
    keys.CLOCK: st.builds(independent.Clock, st.builds(independent.Time, st.integers(0, 2**31 - 1), st.just(5))),
}


def equal(first, other) -> bool:
    """Whether two messages say the same, of whichever library each is."""
    if is_dataclass(first):
        return all(equal(getattr(first, field.name), getattr(other, field.name)) for field in fields(first))
    if isinstance(first, str):
        return first == other
    if isinstance(first, list) and first and (isinstance(first[0], str) or is_dataclass(first[0])):
        return len(first) == len(other) and all(map(equal, first, other))
    return np.array_equal(np.asarray(first, np.float64), np.asarray(other, np.float64), equal_nan=True)


@pytest.mark.parametrize("kind", SAMPLES)
@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_messages_of_the_other_library_are_read_and_written_alike(kind, data):
    theirs = data.draw(SAMPLES[kind])
    frame = theirs.serialize()
    ours = MESSAGES.decode(kind, frame)
    assert equal(theirs, ours)
    assert equal(independent.BY_KIND[kind].deserialize(MESSAGES.encode(kind, ours)), ours)


@pytest.mark.parametrize("kind", SAMPLES)
@settings(max_examples=15, deadline=None)
@given(data=st.data())
def test_truncated_message_is_malformed(kind, data):
    frame = data.draw(SAMPLES[kind]).serialize()
    half = frame[: data.draw(st.integers(0, len(frame) - 5))]
    with pytest.raises(BadFrame, match="malformed"):
        MESSAGES.decode(kind, half)


@given(linear=FINITE, angular=FINITE, lateral=FINITE, stamp=STAMPS, frame=FRAMES)
def test_commands_encoded_by_hand_match_the_library(linear, angular, lateral, stamp, frame):
    ours, theirs = messages.Velocities(linear, angular, lateral), independent.twist(linear, angular, lateral)
    assert messages.encode_twist(ours) == theirs.serialize()
    assert len(theirs.serialize()) == 52
    stamped = independent.TwistStamped(independent.header(stamp, frame), theirs).serialize()
    assert messages.encode_twist_stamped(ours, stamp, frame) == stamped
    assert messages.decode_twist(theirs.serialize()) == ours
    for frame_bytes in (theirs.serialize(), stamped):
        assert messages.decode_either(frame_bytes) == ours


@settings(max_examples=25, deadline=None)
@given(linear=FINITE, angular=FINITE, frame=FRAMES)
def test_commands_of_either_endianness_are_equal(linear, angular, frame):
    message = independent.TwistStamped(independent.header(5, frame), independent.twist(linear, angular))
    assert messages.decode_either(message.serialize(endianness=Endianness.Big)) == messages.Velocities(linear, angular)
    plain = message.twist.serialize(endianness=Endianness.Big)
    assert messages.decode_either(plain) == messages.Velocities(linear, angular)


@pytest.mark.parametrize("broken", [float("nan"), float("inf"), float("-inf")])
def test_velocity_that_is_not_finite_is_refused(broken):
    with pytest.raises(BadFrame):
        messages.decode_either(independent.twist(0.1, broken).serialize())


@given(st.binary(max_size=120))
def test_garbage_is_refused_or_decodes_to_finite_velocities(payload):
    try:
        velocities = messages.decode_either(payload)
    except BadFrame:
        return
    assert np.all(np.isfinite(velocities))


def gateway_messages() -> dict[str, object]:
    """A message of each kind that a gateway sends, made from readings."""
    scan = load_body("turtlebot3-burger").scan
    assert scan is not None
    poses = WheelPoses(2, 0.16, OdometrySpec(slip=0.01))
    poses.add(0, np.zeros(2), np.zeros(2))
    poses.add(100_000_000, np.array([0.0, 0.1]), np.array([0.0, 0.2]))
    return {
        keys.LASER_SCAN: laser_scan(MESSAGES, scan, DEFAULT_NAMES, np.full(360, np.inf), 3),
        keys.ODOMETRY: poses.message(MESSAGES, 1, 3),
        keys.IMU: imu(MESSAGES, Motion(1.0, 2.0, 3.0, 0.5), 0.0, 3),
        keys.BATTERY_STATE: battery_state(MESSAGES, 0.5, 11.0, 3),
        keys.ILLUMINANCE: illuminance(MESSAGES, 0.5, 800.0, "cell", 3),
        keys.CLOCK: MESSAGES.make(keys.CLOCK, MESSAGES.time(3)),
        keys.JOINT_STATE: joint_state(MESSAGES, DEFAULT_NAMES, poses.travel_m[1], poses.wheel_mps[1], 0.033, 3),
        messages.HAZARDS: readings.hazards(MESSAGES, pressed=True, shade=SHADE, stamp_ns=3),
        messages.INTENSITIES: readings.cliff_intensities(MESSAGES, SHADE, 3),
        messages.DOCK_STATUS: readings.dock_status(MESSAGES, 3),
        messages.STOP_STATUS: readings.stop_status(MESSAGES, stopped=True, stamp_ns=3),
        messages.WHEEL_TICKS: readings.wheel_ticks(MESSAGES, poses.travel_m[1], 0.03575, 3),
        messages.WHEEL_VELS: readings.wheel_vels(MESSAGES, poses.wheel_mps[1], 0.03575, 3),
    }


@pytest.mark.parametrize("kind", gateway_messages())
def test_gateway_messages_match_the_other_library_to_the_byte(kind):
    frame = MESSAGES.encode(kind, gateway_messages()[kind])
    theirs = independent.BY_KIND[kind].deserialize(frame)
    assert equal(theirs, MESSAGES.decode(kind, frame))
    assert theirs.serialize() == frame
