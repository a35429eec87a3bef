"""The gateway, a bridge and rmw_zenoh, decoded by another library."""

import json
from collections import deque
from math import cos, sin
from typing import Any

import numpy as np
import pytest
import zenoh
from zenoh.ext import HistoryConfig, Int64, declare_advanced_subscriber, z_deserialize

from swarmwire.comms.protocols.ros2.keys import RANGE
from swarmwire.comms.protocols.ros2.links import close
from swarmwire.comms.protocols.ros2.messages import Messages
from swarmwire.comms.protocols.ros2.transforms import sensor_frames
from swarmwire.comms.robot.bodies.body import load_body
from swarmwire.world.gateways.ros2 import Ros2Gateway, Ros2GatewayOptions
from swarmwire.world.gateways.ros2.base import ReadingRate
from swarmwire.world.gateways.ros2.publishers import broadcasters_of
from tests.support.clocks import until
from tests.support.comms.protocols.ros2 import independent
from tests.support.refusals import refused_input
from tests.support.world.gateways import (
    ALIVE,
    PROPER,
    TICK_NS,
    TWIST,
    TWIST_STAMPED,
    UTC_NS,
    DatedStillClock,
    readings,
    ros_node,
    turtlebot,
)

# pycdr2 has arrays for types that are lists in fact:
# pyright: reportIndexIssue=false, reportGeneralTypeIssues=false


TOPICS = {
    "scan": "sensor_msgs/msg/LaserScan",
    "odom": "nav_msgs/msg/Odometry",
    "joint_states": "sensor_msgs/msg/JointState",
    "imu": "sensor_msgs/msg/Imu",
    "battery_state": "sensor_msgs/msg/BatteryState",
    "illuminance": "sensor_msgs/msg/Illuminance",
}
OF_ROBOT = 10  # tokens in the graph of rmw_zenoh: a node, and its topics
IN_RMW = 2 * OF_ROBOT + 2  # plus the clock and its node
IN_BRIDGE = 2 * (OF_ROBOT - 1) + 2  # plus the clock and the bridge
GO = independent.twist(0.1, -0.5).serialize()


def dds(kind: str) -> str:
    package, _, name = kind.split("/")
    return f"{package}::msg::dds_::{name}_"


FRAMES = {"tf": "tf2_msgs/msg/TFMessage", "tf_static": "tf2_msgs/msg/TFMessage"}


def test_topics_reach_bridges_and_rmw_with_the_time_of_their_measurement():
    sensor = {"odom": "odometry", "joint_states": "odometry", "battery_state": "battery", "illuminance": "light"}
    with ros_node() as node:
        sensors = ("scan", "odometry", "imu", "compass", "battery", "light")
        node.ages_ns = {name: 150_000_000 + index for index, name in enumerate(sensors)} | {"imu": 150_000_003}
        bridge = {topic: node.subscribe(f"flock_1/{topic}") for topic in TOPICS}
        rmw = {topic: node.subscribe(f"0/flock_1/{topic}/{dds(kind)}/*") for topic, kind in TOPICS.items()}
        until(lambda: (node.publish(), all((*bridge.values(), *rmw.values())))[1])
    for topic, kind in TOPICS.items():
        assert bridge[topic][-1].attachment is None
        sample = rmw[topic][0]
        number, sent_ns, _ = z_deserialize(tuple[Int64, Int64, bytes], sample.attachment)
        assert int(number) == 1
        assert UTC_NS <= int(sent_ns) <= UTC_NS + 10**12
        assert str(sample.key_expr).rsplit("/", 1)[1].startswith("RIHS01_")
        header = independent.BY_KIND[kind].deserialize(sample.payload.to_bytes()).header
        assert int(sent_ns) - independent.stamp_ns(header) == node.ages_ns[sensor.get(topic, topic)]


def test_readings_have_the_units_and_signs_of_ros():
    with ros_node(full_lux=800.0, north_deg=0.0) as node:
        scan = node.message("flock_1/scan", TOPICS["scan"])
        assert (scan.angle_min, len(scan.ranges)) == (0.0, 360)
        assert scan.angle_max == pytest.approx(np.deg2rad(359.0))
        assert scan.angle_increment == pytest.approx(np.deg2rad(1.0))
        assert (scan.range_min, scan.range_max, scan.scan_time) == pytest.approx((0.12, 3.5, 0.2))
        assert [scan.ranges[ray] for ray in (0, 90)] == [np.inf, 0.5]
        imu = node.message("flock_1/imu", TOPICS["imu"])
        assert (imu.linear_acceleration.x, imu.linear_acceleration.y, imu.angular_velocity.z) == (1.0, 2.0, 0.3)
        assert (imu.orientation.z, imu.orientation.w) == pytest.approx((sin(0.25), cos(0.25)))
        battery = node.message("flock_1/battery_state", TOPICS["battery_state"])
        assert (battery.percentage, battery.voltage) == (0.5, 11.0)
        assert node.message("flock_1/illuminance", TOPICS["illuminance"]).illuminance == 200.0
        odom = node.message("flock_1/odom", TOPICS["odom"])
        assert (odom.header.frame_id, odom.child_frame_id) == ("odom", "base_footprint")


def test_frames_lead_from_odom_to_each_sensor_and_turn():
    with ros_node() as node:
        turned = dict(readings())
        for tick in range(5):
            turned["odometry.left_m"], turned["odometry.right_m"] = (np.array([0.0, by * tick]) for by in (-0.01, 0.01))
            node.publish(turned)
        samples = node.subscribe("flock_1/tf")
        (moved,) = independent.TFMessage.deserialize(node.first(samples, turned).payload.to_bytes()).transforms
        assert (moved.header.frame_id, moved.child_frame_id) == ("odom", "base_footprint")
        turn_rad = 2 * 0.04 / 0.16  # wheels are 0.16 m apart
        assert moved.transform.rotation.z == pytest.approx(sin(turn_rad / 2))
        still = node.message("flock_1/tf_static", FRAMES["tf_static"]).transforms
        parents = {item.child_frame_id: item.header.frame_id for item in still}
        assert parents == dict.fromkeys(("base_scan", "imu_link", "illuminance"), "base_link") | {
            "base_link": "base_footprint"
        }
        (cell,) = (item.transform for item in still if item.child_frame_id == "illuminance")
        assert (cell.translation.x, cell.translation.y) == pytest.approx((0.105, 0.0))


@pytest.mark.parametrize("distro", ["humble", "jazzy"])
def test_proximity_is_published_as_the_distance_from_the_rim(distro):
    body = load_body("epuck2")
    assert body.proximity
    value = body.proximity.response.value(np.array([0.02, np.inf, 0.05]))
    fields = {"proximity.value": np.concatenate([value, np.zeros(5)])[None]}
    messages, broadcasters = Messages(distro), broadcasters_of(body, 1, Ros2GatewayOptions(distro=distro))
    proximity = [broadcaster for broadcaster in broadcasters if broadcaster.topic.startswith("proximity")]
    published: dict[str, Any] = {
        broadcaster.topic: broadcaster.message(messages, fields, 0, 5) for broadcaster in proximity
    }
    assert list(published) == [f"proximity_{index}" for index in range(8)]
    near, none, far = (published[f"proximity_{index}"] for index in range(3))
    assert (near.range, none.range, far.range) == pytest.approx((0.02, np.inf, 0.05))
    assert (near.header.frame_id, near.radiation_type, near.max_range) == ("proximity_0", near.INFRARED, 0.05)
    assert messages.decode(RANGE, messages.encode(RANGE, near)).range == pytest.approx(0.02)
    frames = {frame.name: frame for frame in sensor_frames(body)}
    assert (frames["proximity_2"].x_m, frames["proximity_2"].y_m) == pytest.approx((0.0, -0.035))  # right side


def test_odometry_integrates_the_wheels_without_subscribers():
    with ros_node() as node:
        rolled = dict(readings())
        for tick in range(5):
            for wheel in ("left_m", "right_m"):
                rolled[f"odometry.{wheel}"] = np.array([0.0, 0.02 * tick])
            node.publish(rolled)
        samples = node.subscribe("flock_1/odom")
        odom = independent.Odometry.deserialize(node.first(samples, rolled).payload.to_bytes())
        assert odom.pose.pose.position.x == pytest.approx(0.08)


@pytest.mark.parametrize("key", ["flock_1/tf_static", "0/flock_1/tf_static/tf2_msgs::msg::dds_::TFMessage_/*"])
def test_late_subscriber_with_history_gets_the_static_frames(key):
    """The subscription of transient local readers in rmw_zenoh and bridges."""
    with ros_node() as node:
        node.publish()
        samples: deque[zenoh.Sample] = deque()
        history = HistoryConfig(detect_late_publishers=True, max_samples=100)
        subscriber = declare_advanced_subscriber(node.session, key, samples.append, history=history)
        (sample,) = until(lambda: samples)
        frames = independent.TFMessage.deserialize(sample.payload.to_bytes()).transforms
        assert "base_scan" in {item.child_frame_id for item in frames}
        subscriber.undeclare()


@pytest.mark.parametrize(("rate_hz", "due"), [(0.0, 11), (10.0, 11), (5.0, 6), (3.0, 4), (30.0, 11)])
def test_sensor_is_published_at_its_rate(rate_hz, due):
    rate = ReadingRate(rate_hz)
    assert sum(rate.is_due(tick * TICK_NS) for tick in range(11)) == due


def test_lost_reading_is_not_published():
    with ros_node() as node:
        lost = {name: np.full_like(value, np.nan) for name, value in readings().items()}
        imu, scan = node.subscribe("flock_1/imu"), node.subscribe("flock_1/scan")
        node.first(scan, lost)
        assert not imu
        node.first(imu)


@pytest.mark.parametrize(
    ("key", "stamped", "attachment"),
    [
        ("flock_1/cmd_vel", False, None),
        ("flock_1/cmd_vel", True, None),
        (TWIST, False, PROPER),
        (TWIST_STAMPED, True, PROPER),
    ],
)
def test_command_drives_the_robot_of_its_topic(key, stamped, attachment):
    twist = independent.twist(0.1, -0.5)
    message = independent.TwistStamped(independent.header(5, "base_link"), twist) if stamped else twist
    with ros_node() as node:
        node.session.put(key, message.serialize(), attachment=attachment)
        assert node.next_command() == (0.1, -0.5)
        assert not node.gateway.pop_commands().drive.any()
        assert node.gateway.counts() == {}


def test_rmw_zenoh_session_subscribes_drives_and_meets_its_peers():
    """Peers that connect to the gateway as their router, and by gossip to each other."""
    with ros_node() as node:
        config = {
            "mode": "peer",
            "connect": {"endpoints": [node.addresses[0]]},
            "listen": {"endpoints": ["tcp/localhost:0"]},
            "scouting": {"delay": 1, "multicast": {"enabled": False}, "gossip": {"enabled": True}},
        }
        first, other = (zenoh.open(zenoh.Config.from_json5(json.dumps(config))) for _ in range(2))
        try:
            scans, greetings = (
                first.declare_subscriber(f"0/flock_1/scan/{dds(TOPICS['scan'])}/*"),
                other.declare_subscriber("0/x"),
            )
            until(lambda: (node.publish(), scans.try_recv())[1], lambda sample: sample is not None)
            first.put(TWIST, GO, attachment=PROPER)
            assert node.next_command() == (0.1, -0.5)
            until(lambda: (first.put("0/x", b"hello"), greetings.try_recv())[1], lambda sample: sample is not None)
        finally:
            close(first)
            close(other)


def test_base_without_commands_stops_once():
    with ros_node() as node:
        node.session.put("flock_1/cmd_vel", GO)
        assert node.next_command() == (0.1, -0.5)
        node.clock.time_ns += 499_000_000
        assert not node.gateway.pop_commands().drive.any()
        node.clock.time_ns += 2_000_000
        assert node.next_command() == (0.0, 0.0)
        node.clock.time_ns += 10**12
        assert not node.gateway.pop_commands().drive.any()
        assert node.gateway.counts() == {"command_timeouts": 1}


def test_malformed_commands_are_counted_and_ignored():
    with ros_node() as node:
        broken = [b"", b"\0\1\0\0", GO[:-1], GO + bytes(8), b"\7" * 52, independent.twist(np.nan, 0.0).serialize()]
        for payload in broken:
            node.session.put("flock_1/cmd_vel", payload)
        for attachment in (None, b"", PROPER[:-1]):
            node.session.put(TWIST, GO, attachment=attachment)
        node.session.put(TWIST_STAMPED, GO, attachment=PROPER)
        until(node.gateway.counts, lambda counts: counts == {"malformed": len(broken) + 1, "no_attachment": 3})
        assert not node.gateway.pop_commands().drive.any()


def tokens(node, pattern: str) -> set[str]:
    return {str(reply.ok.key_expr) for reply in node.session.liveliness().get(pattern)}


def test_liveliness_tokens_list_nodes_and_topics_of_every_robot():
    with ros_node() as node:
        rmw = until(lambda: tokens(node, "@ros2_lv/0/**"), lambda listed: len(listed) == IN_RMW)
        shown = {"/".join(token.split("/")[5:12]) for token in rmw}
        for robot in ("flock_0", "flock_1"):
            assert f"NN/%/%{robot}/base" in shown
            for topic, kind in (TOPICS | FRAMES).items():
                assert f"MP/%/%{robot}/base/%{robot}%{topic}/{dds(kind)}" in {t.rsplit("/", 1)[0] for t in shown}
            assert any(token.startswith(f"MS/%/%{robot}/base/%{robot}%cmd_vel/") for token in shown)
        assert "NN/%/%/world" in shown
        assert any(token.startswith("MP/%/%/world/%clock/rosgraph_msgs::msg::dds_::Clock_/RIHS01_") for token in shown)
        assert len({tuple(token.split("/")[3:5]) for token in rmw}) == IN_RMW  # unique ids of nodes and topics
        bridge = until(lambda: tokens(node, "@/*/@ros2_lv/**"), lambda listed: len(listed) == IN_BRIDGE)
        assert any("/MP/clock/rosgraph_msgs§msg§Clock/:1:0:0,10:typehash=RIHS01_" in t for t in bridge)
        assert any("/MP/flock_1§scan/sensor_msgs§msg§LaserScan/:1:0:0,10:typehash=RIHS01_64c1" in t for t in bridge)
        assert any("/MS/flock_1§cmd_vel/geometry_msgs§msg§Twist/" in t for t in bridge)


def test_stamped_commands_are_announced_by_option():
    with ros_node(stamped=True, distro="humble") as node:
        rmw = until(lambda: tokens(node, "@ros2_lv/0/**"), lambda listed: len(listed) == IN_RMW)
        assert sum("cmd_vel/geometry_msgs::msg::dds_::TwistStamped_/TypeHashNotSupported/" in t for t in rmw) == 2


def test_dead_robot_vanishes_from_ros_until_it_is_revived():
    with ros_node() as node:
        samples = node.subscribe("flock_1/imu")
        node.first(samples)
        node.session.put("flock_1/cmd_vel", GO)
        node.next_command()
        cache_key = "flock_1/tf_static/@adv/**"  # cache for late subscribers
        assert tokens(node, cache_key)
        node.publish(alive=np.array([True, False]))
        until(lambda: not tokens(node, cache_key))
        rmw = until(lambda: tokens(node, "@ros2_lv/0/**"), lambda listed: len(listed) == IN_RMW - OF_ROBOT)
        assert not any("flock_1" in token for token in rmw)
        samples.clear()
        assert node.next_command() == (0.0, 0.0)
        node.session.put("flock_1/cmd_vel", GO)
        node.session.put("flock_0/cmd_vel", GO)  # arrives last
        commands = until(node.gateway.pop_commands, lambda commands: commands.drive.any())
        assert commands.drive.tolist() == [True, False]
        node.publish(alive=np.array([True, False]))
        assert not samples
        node.publish(alive=ALIVE)
        until(lambda: tokens(node, "@ros2_lv/0/**"), lambda listed: len(listed) == IN_RMW)
        node.first(samples)


def test_clock_topic_equals_the_stamps():
    with ros_node() as node:
        imu, clock = node.subscribe("flock_1/imu"), node.subscribe("0/clock/rosgraph_msgs::msg::dds_::Clock_/*")
        until(lambda: (node.publish(), imu and clock)[1])
        until(lambda: (node.publish(), {stamp(item) for item in imu} & {time(item) for item in clock})[1])


def stamp(sample: zenoh.Sample) -> int:
    return independent.stamp_ns(independent.Imu.deserialize(sample.payload.to_bytes()).header)


def time(sample: zenoh.Sample) -> int:
    shown = independent.Clock.deserialize(sample.payload.to_bytes()).clock
    return shown.sec * 10**9 + shown.nanosec


def test_endpoint_of_the_gateway_is_free_after_its_close():
    with ros_node() as node:
        address = node.addresses[0]
        assert node.addresses == (address, address)
        again = gateway(address)
        with refused_input("ros2", "address", address):
            again.open()
    again.open()
    again.close()
    again.close()


def gateway(address: str, names=("flock-0",)) -> Ros2Gateway:
    return Ros2Gateway(names, turtlebot(), address, Ros2GatewayOptions(), DatedStillClock())


def test_address_that_is_no_endpoint_is_refused():
    with refused_input("ros2", "address"):
        gateway("127.0.0.1:7447")


def test_robot_names_that_are_equal_in_ros_are_refused():
    with refused_input(match="flock_0"):
        gateway("", names=("flock-0", "flock_0"))


def test_body_with_few_sensors_is_published():
    kilobot = Ros2Gateway(["a"], load_body("kilobot"), "", Ros2GatewayOptions(), DatedStillClock())
    kilobot.open()
    kilobot.publish(0, {"light.value": np.zeros((1, 1))}, np.ones(1, np.bool_))
    kilobot.close()
