"""Wheels of emulated bases, and hazards, cliffs and docks of Create 3 bases, decoded by another library."""

from math import cos, pi, radians, sin

import numpy as np
import pytest

from swarmwire.comms.robot.bodies.body import load_body
from tests.support.world.gateways import ros_node

# pycdr2 has arrays for types that are lists in fact:
# pyright: reportGeneralTypeIssues=false

HAZARDS = "irobot_create_msgs/msg/HazardDetectionVector"
BUMP, CLIFF = 1, 2


def turtlebot4_readings(**fields) -> dict[str, np.ndarray]:
    """Readings of flock-0 and flock-1, which has a wall ahead of its scanner."""
    scan_m = np.full((2, 360), np.inf)
    body = load_body("turtlebot4")
    assert body.scan
    scan_m[1, np.argmin(np.abs(body.scan.angle_rad))] = 0.5
    return {
        "scan.range_m": scan_m,
        "odometry.left_m": np.zeros(2),
        "odometry.right_m": np.zeros(2),
        "imu.forward_mps2": np.zeros(2),
        "imu.left_mps2": np.zeros(2),
        "imu.turn_radps": np.zeros(2),
        "bumper.pressed": np.zeros(2),
        "ground.shade": np.ones((2, 4)),
        "battery.charge": np.ones(2),
        "battery.voltage_v": np.full(2, 16.8),
    } | fields


def rolling(tick: int) -> dict[str, np.ndarray]:
    """Readings if in each tick the left wheel of flock-1 rolls 1 cm back, and the right wheel 2 cm ahead."""
    travel_m = {"odometry.left_m": np.array([0.0, -0.01 * tick]), "odometry.right_m": np.array([0.0, 0.02 * tick])}
    return turtlebot4_readings() | travel_m


@pytest.mark.parametrize(
    ("body", "joints"),
    [
        ("turtlebot3-burger", ["wheel_left_joint", "wheel_right_joint"]),
        ("turtlebot4", ["left_wheel_joint", "right_wheel_joint"]),
    ],
)
def test_joint_positions_follow_the_rolled_distance(body, joints):
    sheet = load_body(body)
    with ros_node(sheet) as node:
        state = node.message("flock_1/joint_states", "sensor_msgs/msg/JointState", rolling(5))
        radius_m = sheet.wheels.wheel_radius_m
        assert (state.name, state.effort) == (joints, [])
        assert state.position == pytest.approx([-0.05 / radius_m, 0.1 / radius_m])
        still = node.message("flock_0/joint_states", "sensor_msgs/msg/JointState", rolling(5))
        assert (still.position, still.velocity) == ([0.0, 0.0], [0.0, 0.0])


def test_scan_of_a_turned_scanner_fits_its_static_frame():
    with ros_node(load_body("turtlebot4")) as node:
        scan = node.message("flock_1/scan", "sensor_msgs/msg/LaserScan", turtlebot4_readings())
        assert (scan.header.frame_id, len(scan.ranges)) == ("rplidar_link", 360)
        assert (scan.angle_min, scan.angle_max) == pytest.approx((radians(-179), pi))
        assert (scan.range_min, scan.range_max) == pytest.approx((0.15, 12.0))
        (ray,) = np.flatnonzero(np.isfinite(scan.ranges))
        angle = scan.angle_min + ray * scan.angle_increment
        assert angle == pytest.approx(-pi / 2, abs=1e-6)
        still = node.message("flock_1/tf_static", "tf2_msgs/msg/TFMessage", turtlebot4_readings()).transforms
        (mount,) = (item.transform for item in still if item.child_frame_id == "rplidar_link")
        yaw = 2 * np.arctan2(mount.rotation.z, mount.rotation.w)
        at = (mount.translation.x + 0.5 * cos(yaw + angle), mount.translation.y + 0.5 * sin(yaw + angle))
        assert at == pytest.approx((-0.04 + 0.5, 0.0), abs=1e-6)


@pytest.mark.parametrize(
    ("pressed", "shade", "detections"),
    [
        (0.0, [1.0, 1.0, 1.0, 1.0], []),
        (1.0, [1.0, 1.0, 1.0, 1.0], [(BUMP, "bump_front_center")]),
        (0.0, [0.0, 0.5, 1.0, 0.05], [(CLIFF, "cliff_side_left"), (CLIFF, "cliff_side_right")]),
        (np.nan, [np.nan] * 4, []),
    ],
)
def test_bumps_and_black_floor_are_hazards_in_frames_of_the_base(pressed, shade, detections):
    of_robots = {"bumper.pressed": np.array([1.0, pressed]), "ground.shade": np.array([[0.0] * 4, shade])}
    with ros_node(load_body("turtlebot4")) as node:
        hazards = node.message("flock_1/hazard_detection", HAZARDS, turtlebot4_readings(**of_robots))
        assert [(item.type, item.header.frame_id) for item in hazards.detections] == detections
        still = node.message("flock_1/tf_static", "tf2_msgs/msg/TFMessage", turtlebot4_readings()).transforms
        assert {frame for _, frame in detections} <= {item.child_frame_id for item in still}


def test_cliff_intensity_follows_the_floor_and_no_dock_is_visible():
    shade = np.array([[1.0] * 4, [1.0, 0.5, 0.0, 0.25]])
    with ros_node(load_body("turtlebot4")) as node:
        fields = turtlebot4_readings(**{"ground.shade": shade})
        floor = node.message("flock_1/cliff_intensity", "irobot_create_msgs/msg/IrIntensityVector", fields)
        assert [item.value for item in floor.readings] == [2200, 1100, 0, 550]
        dock = node.message("flock_1/dock_status", "irobot_create_msgs/msg/DockStatus", fields)
        assert (dock.dock_visible, dock.is_docked) == (False, False)


def test_bumper_is_published_only_for_a_create_3():
    with ros_node(load_body("turtlebot4")) as node:
        assert node.gateway.differences() == ()
    with ros_node(load_body("epuck2")) as node:
        assert "no program receives its bumper, ground" in node.gateway.differences()
