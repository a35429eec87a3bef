"""rosbags and cyclonedds read every kind of message of emulated bases, write the same bytes, and see the world in them.

docs/ros2.md has the table of these kinds.
"""

import sys
import tomllib
from collections import defaultdict
from collections.abc import Iterable
from functools import cache
from math import cos, hypot, inf, pi, sin
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from swarmwire.comms.protocols.ros2.links import close, open_client
from swarmwire.comms.protocols.ros2.messages import DEFINITIONS
from swarmwire.comms.robot.bodies.body import Body, body_from
from swarmwire.deploy import Simulation
from swarmwire.deploy.cli.actions.run import parse_gateways
from tests.support.clocks import until
from tests.support.comms.protocols.ros2 import independent
from tests.support.comms.protocols.ros2.navigation import ODOM, Pose, combined
from tests.support.deploy.runs import ROOT

SIZE_M, START = (2.0, 1.6), (0.3, -0.35, 0.7)
PHASES = {"curve": (30, 0.15, 0.4), "rest": (15, 0.0, 0.0), "wall": (70, 0.2, 0.0)}  # ticks, m/s, rad/s
SENSOR_MSGS, CREATE3 = "sensor_msgs/msg/", "irobot_create_msgs/msg/"
KINDS = {
    "scan": SENSOR_MSGS + "LaserScan",
    "odom": "nav_msgs/msg/Odometry",
    "joint_states": SENSOR_MSGS + "JointState",
    "imu": SENSOR_MSGS + "Imu",
    "battery_state": SENSOR_MSGS + "BatteryState",
    "illuminance": SENSOR_MSGS + "Illuminance",
    "proximity": SENSOR_MSGS + "Range",
    "tf": "tf2_msgs/msg/TFMessage",
    "tf_static": "tf2_msgs/msg/TFMessage",
    "clock": "rosgraph_msgs/msg/Clock",
    "hazard_detection": CREATE3 + "HazardDetectionVector",
    "cliff_intensity": CREATE3 + "IrIntensityVector",
    "dock_status": CREATE3 + "DockStatus",
    "wheel_ticks": CREATE3 + "WheelTicks",
    "wheel_vels": CREATE3 + "WheelVels",
    "stop_status": CREATE3 + "StopStatus",
}
COMMON = ["scan", "odom", "joint_states", "imu", "battery_state", "proximity", "tf", "tf_static", "clock"]
TOPICS = {"avoidance-turtlebot": [*COMMON, "illuminance"], "avoidance-turtlebot4": [*COMMON, *list(KINDS)[10:]]}
Payloads = dict[str, list[bytes]]  # by topic, in the order in which they came
SCENARIOS = pytest.mark.parametrize("scenario", TOPICS)


@cache
def of_cyclonedds() -> ModuleType:
    """The definitions of `independent` for cyclonedds, whose names pycdr2 has."""
    pytest.importorskip("cyclonedds")
    module = sys.modules[f"{__name__}.of_cyclonedds"] = ModuleType(f"{__name__}.of_cyclonedds")
    source = Path(independent.__file__).read_text(encoding="utf-8").replace("from pycdr2", "from cyclonedds.idl")
    exec(compile(source, independent.__file__, "exec"), vars(module))
    return module


@cache
def of_rosbags() -> Any:
    """The messages of Jazzy as rosbags has them, with those of a Create 3."""
    store = get_typestore(Stores.ROS2_JAZZY)
    for kind, definition in DEFINITIONS.items():
        store.register(get_types_from_msg(definition, kind))
    return store


def body_of(scenario: str) -> Body:
    path = ROOT / "scenarios" / "robots" / f"{scenario.removeprefix('avoidance-')}.toml"
    return body_from(tomllib.loads(path.read_text(encoding="utf-8")), path.name)


def kind_of(topic: str) -> str:
    return KINDS[topic.rstrip("0123456789").rstrip("_")]


@cache
def recorded(scenario: str) -> tuple[dict[str, Payloads], dict[str, Pose]]:
    """The messages of a base in each phase, and where it then is; a TurtleBot 4 gets TwistStamped of cyclonedds."""
    overrides = ["robots.wanderers.count=1", "arena.obstacles=[]", f"arena.size_m={[*SIZE_M]}", "duration_s=60"]
    overrides += [f'robots.wanderers.place={{how="poses",poses=[{[*START]}]}}']
    overrides += ["arena.lights=[{at=[0.9,0.7],intensity=3.0}]"]
    gateways = parse_gateways(["ros2"], ["cmd_timeout_s=600"], None, None)
    came, phases, poses = Payloads(), dict[str, Payloads](), dict[str, Pose]()
    path = ROOT / "scenarios" / "robots" / f"{scenario}.toml"
    with Simulation(path, gateways=gateways, realtime=10.0, overrides=overrides) as simulation:
        assert simulation.served is not None
        session = open_client(simulation.served.robots[0].address, 5.0)
        try:
            for key in ("wanderers_0/*", "clock"):
                session.declare_subscriber(
                    key,
                    lambda message: came.setdefault(str(message.key_expr).split("/")[-1], []).append(
                        message.payload.to_bytes()
                    ),
                )
            expected_topics = {*TOPICS[scenario]} - {"proximity", "illuminance"} | {"proximity_0"}
            until(lambda: (simulation.run(simulation.tick + 1), expected_topics <= came.keys())[1])
            for phase, (ticks, linear_mps, angular_radps) in PHASES.items():
                came.clear()
                for _ in range(ticks):
                    session.put("wanderers_0/cmd_vel", command(scenario, linear_mps, angular_radps))
                    before = len(came.get("clock", ()))
                    simulation.run(simulation.tick + 1)
                    until(lambda before=before: len(came.get("clock", ())) > before)  # the last of a tick
                phases[phase] = {topic: [*message] for topic, message in came.items() if topic != "cmd_vel"}
                poses[phase] = tuple(map(float, simulation.world.pose[0]))
        finally:
            close(session)
    return phases, poses


def command(scenario: str, linear_mps: float, angular_radps: float) -> bytes:
    """A Twist of rosbags, or a TwistStamped of cyclonedds."""
    if scenario.endswith("4"):
        dds = of_cyclonedds()
        return dds.TwistStamped(dds.header(), dds.twist(linear_mps, angular_radps)).serialize()
    types = of_rosbags().types
    vector = types["geometry_msgs/msg/Vector3"]
    twist = types["geometry_msgs/msg/Twist"](vector(linear_mps, 0.0, 0.0), vector(0.0, 0.0, angular_radps))
    return bytes(of_rosbags().serialize_cdr(twist, "geometry_msgs/msg/Twist"))


def read(scenario: str, phase: str) -> dict[str, list[Any]]:
    """The messages of a phase by topic, as cyclonedds reads them."""
    kinds, phases = of_cyclonedds().BY_KIND, recorded(scenario)[0]
    return {
        topic: [kinds[kind_of(topic)].deserialize(message) for message in came] for topic, came in phases[phase].items()
    }


@SCENARIOS
def test_messages_are_equal_bytes_in_both_libraries(scenario):
    dds, bags = of_cyclonedds().BY_KIND, of_rosbags()
    counts = defaultdict[str, int](int)
    for phase in recorded(scenario)[0].values():
        for topic, payloads in phase.items():
            kind = kind_of(topic)
            for payload in payloads:
                assert dds[kind].deserialize(payload).serialize() == payload
                assert bytes(bags.serialize_cdr(bags.deserialize_cdr(payload, kind), kind)) == payload
                counts[kind] += 1
    assert counts.keys() == {KINDS[topic] for topic in TOPICS[scenario]}


def yaw(message: Any) -> float:
    return 2 * np.arctan2(message.z, message.w)


def off_by(one_rad: float, other_rad: float) -> float:
    return abs((one_rad - other_rad + pi) % (2 * pi) - pi)


@SCENARIOS
def test_motion_in_messages_is_that_of_commands_and_world(scenario):
    curve, standing, poses = read(scenario, "curve"), read(scenario, "rest"), recorded(scenario)[1]
    wheels = body_of(scenario).wheels
    odom, joints, imu = (curve[topic][-1] for topic in ("odom", "joint_states", "imu"))
    assert (odom.twist.twist.linear.x, odom.twist.twist.angular.z) == pytest.approx((0.15, 0.4), rel=0.1)
    assert imu.angular_velocity.z == pytest.approx(0.4, rel=0.1)
    assert imu.linear_acceleration.z == pytest.approx(9.81, abs=0.1)
    rim_mps = np.array([0.15 - 0.2 * wheels.wheel_base_m, 0.15 + 0.2 * wheels.wheel_base_m])
    assert joints.velocity == pytest.approx(rim_mps / wheels.wheel_radius_m, rel=0.1)
    at_rest = standing["odom"][-1].pose.pose
    pose = combined(START, (at_rest.position.x, at_rest.position.y, yaw(at_rest.orientation)))
    assert hypot(pose[0] - poses["rest"][0], pose[1] - poses["rest"][1]) < 0.05
    assert off_by(pose[2], poses["rest"][2]) < 0.1
    moved = standing["tf"][-1].transforms[0]
    assert (moved.header.frame_id, moved.transform.translation.x) == (ODOM, at_rest.position.x)
    stamps = [message.clock.sec + message.clock.nanosec / 1e9 for message in standing["clock"]]
    assert np.diff(stamps) == pytest.approx(0.1, abs=1e-6)
    battery = standing["battery_state"][-1]
    assert 0.98 < battery.percentage <= 1.0
    if scenario.endswith("4"):
        assert imu.orientation_covariance[0] == -1.0  # it has no compass
        assert battery.voltage == pytest.approx(16.8, abs=0.2)
        assert (curve["wheel_vels"][-1].velocity_left, curve["wheel_vels"][-1].velocity_right) == pytest.approx(
            tuple(joints.velocity), rel=1e-5
        )
        ticks = standing["wheel_ticks"][-1]
        turns = np.array(standing["joint_states"][-1].position) / (2 * pi)
        assert (ticks.ticks_left, ticks.ticks_right) == pytest.approx(tuple(508.8 * turns), abs=1)
        assert not curve["stop_status"][-1].is_stopped
        assert standing["stop_status"][-1].is_stopped
    else:
        assert off_by(yaw(standing["imu"][-1].orientation), poses["rest"][2]) < 0.1
        assert battery.voltage == pytest.approx(12.6, abs=0.2)


def to_wall_m(pose: Pose, angle_rad: float) -> float:
    """The distance from this place to the arena's walls in this direction, which is counted from the heading."""
    x_m, y_m, heading_rad = pose
    ways = (cos(heading_rad + angle_rad), x_m, SIZE_M[0]), (sin(heading_rad + angle_rad), y_m, SIZE_M[1])
    return min((0.5 * size_m * np.sign(way) - at_m) / way for way, at_m, size_m in ways)


def farthest_off(pairs: Iterable[tuple[float, float]]) -> float:
    """The greatest difference of a measured distance and the true one, where something was in range."""
    return max(abs(measured - true) for measured, true in pairs if measured != inf)


@SCENARIOS
def test_distances_in_messages_are_those_of_the_walls(scenario):
    standing, poses = read(scenario, "rest"), recorded(scenario)[1]
    body = body_of(scenario)
    (mount,) = (
        message.transform
        for message in standing["tf_static"][-1].transforms
        if message.child_frame_id == standing["scan"][-1].header.frame_id
    )
    at = combined(poses["rest"], (mount.translation.x, mount.translation.y, yaw(mount.rotation)))
    scan = standing["scan"][-1]
    angles = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
    off_m = [abs(measured - to_wall_m(at, angle)) for measured, angle in zip(scan.ranges, angles, strict=True)]
    assert np.quantile(off_m, 0.99) < 0.05
    proximity = body.sensors["proximity"]
    near = [standing[f"proximity_{k}"][-1] for k in range(len(proximity.angles_deg))]
    true_m = [to_wall_m(poses["rest"], angle) - body.radius_m for angle in np.radians(proximity.angles_deg)]
    assert {message.range != inf for message in near} == {True, False}
    assert all(message.min_range <= message.range <= message.max_range for message in near if message.range != inf)
    hits = [message.range != inf for message in near]
    assert all(true < message.max_range for message, true, is_seen in zip(near, true_m, hits, strict=True) if is_seen)
    assert farthest_off(zip((message.range for message in near), true_m, strict=True)) < 0.05


def test_photocell_towards_the_lamp_reads_the_most():
    pose, came = recorded("avoidance-turtlebot")[1]["rest"], read("avoidance-turtlebot", "rest")
    lux = np.array([came[f"illuminance_{k}"][-1].illuminance for k in range(8)])
    assert 0.0 <= lux.min() < lux.max() <= 1000.0
    lamp_rad = np.arctan2(0.7 - pose[1], 0.9 - pose[0]) - pose[2]
    assert off_by(np.radians(22.5 + 45.0 * lux.argmax()), lamp_rad) < np.radians(45.0)


def test_create_3_reports_a_wall_its_floor_and_no_dock():
    standing, wall = read("avoidance-turtlebot4", "rest"), read("avoidance-turtlebot4", "wall")
    assert standing["hazard_detection"][-1].detections == []
    bumps = {message.type for hazards in wall["hazard_detection"] for message in hazards.detections}
    assert bumps == {1}
    assert [message.value for message in standing["cliff_intensity"][-1].readings] == pytest.approx(
        [2200] * 4, rel=0.05
    )
    assert not any(message.dock_visible or message.is_docked for message in standing["dock_status"])
