"""Keys, hashes, attachments and tokens are those of the bridge and of rmw_zenoh."""

import pytest
import zenoh
from hypothesis import given
from hypothesis import strategies as st
from zenoh.ext import Int64, z_deserialize, z_serialize

from swarmwire.comms.errors import BadFrame, BadInput
from swarmwire.comms.robots.ros2 import keys
from swarmwire.comms.robots.ros2.keys import (
    NAME,
    READ,
    WRITE,
    RmwNode,
    absolute,
    attachment,
    bridge_itself,
    bridge_key,
    bridge_token,
    check_attachment,
    check_name,
    publisher_id,
    rmw_key,
    ros_name,
)
from swarmwire.comms.robots.ros2.messages import Messages

# As `ros2 topic info -v` and rmw_zenoh's design page show them.
HASHES = {
    keys.TWIST: "RIHS01_9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a",
    keys.TWIST_STAMPED: "RIHS01_5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64",
    keys.LASER_SCAN: "RIHS01_64c191398013af96509d518dac71d5164f9382553fce5c1f8cca5be7924bd828",
    keys.ODOMETRY: "RIHS01_3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0",
    keys.IMU: "RIHS01_7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b",
    keys.BATTERY_STATE: "RIHS01_4bee5dfce981c98faa6828b868307a0a73f992ed0789f374ee96c8f840e69741",
}
LONGEST = 2**63 - 1


@pytest.mark.parametrize("distro", ["iron", "jazzy", "kilted"])
@pytest.mark.parametrize("kind", HASHES)
def test_hashes_are_those_that_ros_shows(distro, kind):
    assert Messages(distro).hash_of(kind) == HASHES[kind]


def test_humble_has_no_hashes():
    assert Messages("humble").hash_of(keys.TWIST) == "TypeHashNotSupported"


def test_the_string_of_the_design_page_has_its_hash():
    assert Messages("jazzy").hash_of("std_msgs/msg/String").startswith("RIHS01_df668c740482bbd48fb39d76a70dfd4b")


def test_keys_of_rmw_are_domain_name_kind_and_hash():
    key = rmw_key(0, "/cmd_vel", keys.TWIST, HASHES[keys.TWIST])
    assert key == f"0/cmd_vel/geometry_msgs::msg::dds_::Twist_/{HASHES[keys.TWIST]}"
    assert zenoh.KeyExpr(rmw_key(0, "/cmd_vel", keys.TWIST)).includes(zenoh.KeyExpr(key))
    assert not zenoh.KeyExpr(rmw_key(0, "/cmd_vel", keys.TWIST_STAMPED)).includes(zenoh.KeyExpr(key))


def test_keys_of_the_bridge_are_names():
    assert bridge_key(absolute("bot1", "cmd_vel")) == "bot1/cmd_vel"
    assert bridge_key(absolute("/", "cmd_vel")) == "cmd_vel"


def test_tokens_of_rmw_read_as_its_design_page_writes_them():
    node = RmwNode(2, "aa11", 1, "/flock_0", "base")
    assert node.token == "@ros2_lv/2/aa11/10000/10000/NN/%/%flock_0/base"
    assert node.topic_token(3, "MP", "/flock_0/scan", keys.LASER_SCAN, "RIHS01_64") == (
        "@ros2_lv/2/aa11/10000/10003/MP/%/%flock_0/base/%flock_0%scan/"
        "sensor_msgs::msg::dds_::LaserScan_/RIHS01_64/::,10:,:,:,,"
    )
    assert RmwNode(0, "aa11", 0, "/", "base").token == "@ros2_lv/0/aa11/0/0/NN/%/%/base"
    for token in (node.token, node.topic_token(3, "MP", "/flock_0/scan", keys.LASER_SCAN, "RIHS01_64")):
        assert zenoh.KeyExpr("@ros2_lv/2/**").includes(zenoh.KeyExpr(token))


def test_tokens_of_the_bridge_read_as_its_source_writes_them():
    token = bridge_token("aa11", WRITE, "/flock_0/scan", keys.LASER_SCAN, "RIHS01_64")
    assert bridge_token("aa11", READ, "/flock_0/cmd_vel", keys.TWIST, "").startswith("@/aa11/@ros2_lv/MS/")
    assert token == ("@/aa11/@ros2_lv/MP/flock_0§scan/sensor_msgs§msg§LaserScan/:1:0:0,10:typehash=RIHS01_64;")
    assert zenoh.KeyExpr("@/*/@ros2_lv/**").includes(zenoh.KeyExpr(token))
    assert zenoh.KeyExpr("@/*/@ros2_lv/**").includes(zenoh.KeyExpr(bridge_itself("aa11")))


@given(st.integers(0, LONGEST), st.integers(0, LONGEST), st.text(max_size=30))
def test_an_attachment_is_what_zenoh_serializes(sequence, utc_ns, token):
    attached = attachment(sequence, utc_ns, publisher_id(token))
    assert len(attached) == 33
    values = (Int64(sequence), Int64(utc_ns), publisher_id(token))
    assert bytes(z_serialize(values)) == attached
    assert z_deserialize(tuple[Int64, Int64, bytes], zenoh.ZBytes(attached)) == values
    check_attachment(attached)


@pytest.mark.parametrize("attached", [None, b"", bytes(33), bytes(32), attachment(1, 2, publisher_id("")) + b"0"])
def test_messages_without_a_proper_attachment_are_refused(attached):
    with pytest.raises(BadFrame, match="no_attachment"):
        check_attachment(attached)


@given(st.from_regex(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,20}", fullmatch=True))
def test_a_robot_of_any_name_has_one_that_ros_takes(robot):
    assert NAME.fullmatch(ros_name(robot))


@pytest.mark.parametrize("name", ["", "7up", "a b", "a//b", "a/", "a__b", "flock-0", "~/scan"])
def test_names_that_ros_does_not_have_are_refused(name):
    with pytest.raises(BadInput, match="driver: scan_topic: expected a ROS name"):
        check_name(name, "driver", "scan_topic")


def test_without_rosbags_one_line_says_what_to_install(monkeypatch):
    monkeypatch.setattr("swarmwire.comms.extras.find_spec", lambda _: None)
    with pytest.raises(BadInput, match=r'pip install "swarmwire-agent\[ros2\]"'):
        Messages("jazzy")
