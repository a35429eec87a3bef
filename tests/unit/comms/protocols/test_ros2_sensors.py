"""Sensors of ROS 2 robots: laser scans and all others."""

# pyright: reportIndexIssue=false

from math import cos, hypot, inf, nan, pi, sin
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.agent.drivers.ros2.topics import ImuReader
from swarmwire.comms.base.draws import normal, purpose, uniform
from swarmwire.comms.base.errors import BadFrame
from swarmwire.comms.protocols.ros2.keys import BATTERY_STATE, ILLUMINANCE, IMU, LASER_SCAN, ODOMETRY
from swarmwire.comms.protocols.ros2.laser import LaserAsProximity, LaserAsScan, laser_scan, nearest_angle, returns_m
from swarmwire.comms.protocols.ros2.messages import Messages
from swarmwire.comms.protocols.ros2.motion import (
    Motion,
    WheelPoses,
    WheelTravel,
    imu,
    motion_of,
    motion_sensors,
    motion_variance,
)
from swarmwire.comms.protocols.ros2.readings import battery_state, brightness_of, charge_of
from swarmwire.comms.protocols.ros2.transforms import proximity_range
from swarmwire.comms.robot.bodies.body import Body, body_from, load_body
from swarmwire.comms.robot.bodies.ros2_names import DEFAULT_NAMES
from swarmwire.comms.robot.sensors.rays import ProximitySpec
from swarmwire.comms.robot.sensors.scan import ScanSpec
from swarmwire.comms.robot.sensors.simple import BatterySpec, OdometrySpec
from tests.support.comms.protocols.ros2 import independent
from tests.support.comms.protocols.ros2.independent import Quaternion, odometry

MESSAGES = Messages("jazzy")
LINEAR = {"kind": "quadratic", "a": 0.0, "b": -2.0, "c": 1.0, "reach_m": 0.5}
ANGLES = st.floats(-10.0, 10.0)
BASE_M, MAX_MPS = 0.16, 0.22
TICK_NS = 100_000_000
STEPS = st.lists(st.tuples(st.floats(-0.03, 0.03), st.floats(-0.03, 0.03)), min_size=1, max_size=60)
VALUES = st.floats(-5.0, 5.0)


def received(message: independent.LaserScan):
    return MESSAGES.decode(LASER_SCAN, message.serialize())


def body(at_m: float = 0.0) -> Body:
    angles_deg = [0, 30, -30, 90, -90, 180]
    proximity = {"angles_deg": angles_deg, "range_m": 0.4, "response": LINEAR}
    return body_from({"like": "turtlebot3-burger", "sensors": {"proximity": proximity, "scan": {"at_m": at_m}}}, "b")


def proximity_of(sheet: Body) -> ProximitySpec:
    assert sheet.proximity
    return sheet.proximity


@given(st.lists(ANGLES, min_size=1, max_size=20), st.lists(ANGLES, min_size=1, max_size=20))
def test_nearest_angle_equals_a_brute_force_search(targets, among):
    targets, among = np.array(targets), np.array(among)
    apart = np.abs(np.remainder(targets[:, None] - among[None] + pi, 2 * pi) - pi)
    index, apart_rad = nearest_angle(targets, among)
    assert apart_rad == pytest.approx(apart.min(axis=1), abs=1e-9)
    assert apart[np.arange(len(targets)), index] == pytest.approx(apart.min(axis=1), abs=1e-9)


def scans():
    spec = st.builds(
        ScanSpec,
        rays=st.integers(1, 90),
        range_m=st.just(3.5),
        range_min_m=st.just(0.12),
        first_deg=st.floats(-180, 180),
        span_deg=st.sampled_from([30.0, 180.0, 270.0, 360.0]),
    )
    return spec.flatmap(
        lambda spec: st.tuples(
            st.just(spec), st.lists(st.floats(0.12, 3.5) | st.just(inf), min_size=spec.rays, max_size=spec.rays)
        )
    )


@given(scans())
def test_scan_survives_between_gateway_and_driver(drawn):
    spec, range_m = drawn
    range_m = np.array(range_m)
    message = MESSAGES.decode(
        LASER_SCAN, MESSAGES.encode(LASER_SCAN, laser_scan(MESSAGES, spec, DEFAULT_NAMES, range_m, 0))
    )
    assert LaserAsScan(spec, 0.0).range_m(message) == pytest.approx(range_m, rel=1e-6)


@pytest.mark.parametrize(
    ("told_m", "reads_m"),
    [(1.0, 1.0), (inf, inf), (nan, inf), (0.0, inf), (-inf, 0.12), (0.05, 0.12), (11.0, inf), (5.0, inf), (3.5, 3.5)],
)
def test_scan_returns_out_of_range_read_inf_or_the_minimum(told_m, reads_m):
    spec = load_body("turtlebot3-burger").scan
    assert spec
    message = received(independent.laser_scan([told_m] * 8, range_min=0.1))
    assert LaserAsScan(spec, 0.0).range_m(message)[0] == pytest.approx(reads_m)


@pytest.mark.parametrize(
    ("ranges", "first_rad", "step_rad", "spec", "mounted_rad", "expected"),
    [
        # Back, right, ahead, left; read at the same rays, and at the nearest of others.
        ([1.0, 2.0, 3.0, 4.0], -pi, None, {"rays": 4}, 0.0, [3.0, 4.0, 1.0, 2.0]),
        ([1.0, 2.0, 3.0, 4.0], -pi, None, {"rays": 8, "first_deg": 1.0}, 0.0, [3.0, 4.0, 4.0, 1.0, 1.0, 2.0, 2.0, 3.0]),
        # Ahead, right, back, left; of a scanner that is turned by a quarter, too.
        ([1.0, 2.0, 3.0, 4.0], 0.0, -pi / 2, {"rays": 4}, 0.0, [1.0, 4.0, 3.0, 2.0]),
        ([1.0, 2.0, 3.0, 4.0], 0.0, -pi / 2, {"rays": 4}, pi / 2, [2.0, 1.0, 4.0, 3.0]),
        # A quarter of a circle ahead.
        ([1.0] * 91, -pi / 4, pi / 180, {"rays": 8}, 0.0, [1.0, 1.0, inf, inf, inf, inf, inf, 1.0]),
    ],
    ids=["equal rays", "nearest rays", "clockwise", "turned", "outside the field of view"],
)
def test_scan_is_read_at_the_angles_of_the_sheet(ranges, first_rad, step_rad, spec, mounted_rad, expected):
    message = received(independent.laser_scan(ranges, first_rad, step_rad))
    assert LaserAsScan(ScanSpec(range_m=9.0, **spec), mounted_rad).range_m(message).tolist() == expected


@pytest.mark.parametrize("broken", [{"first_rad": nan}, {"step_rad": inf}])
def test_scan_with_infinite_angles_or_without_rays_is_a_bad_frame(broken):
    message = received(independent.laser_scan([1.0] * 4, **{"first_rad": 0.0, "step_rad": 0.1, **broken}))
    for reader in (LaserAsScan(ScanSpec(rays=4, range_m=9.0), 0.0).range_m, near().value):
        with pytest.raises(BadFrame):
            reader(message)
    with pytest.raises(BadFrame):
        near().value(received(independent.laser_scan([], step_rad=0.1)))


def near(at_m: float = 0.0, scanner_rad: float = 0.0) -> LaserAsProximity:
    sheet = body(at_m)
    return LaserAsProximity(proximity_of(sheet), sheet.radius_m, at_m, scanner_rad)


def test_proximity_from_scan_is_the_nearest_return_of_each_sector():
    ranges = np.full(360, inf)
    ranges[10], ranges[14] = 0.305, 0.405  # both nearest to the sensor ahead
    ranges[20] = 0.205  # to the one at 30 degrees
    ranges[-100] = 0.105  # to the one at -90 degrees: at the rim
    ranges[135 + 3] = 0.2  # between 90 and 180 degrees, nearer to 180, more than 45 degrees off neither
    value = near().value(received(independent.laser_scan(ranges)))
    assert value == pytest.approx([1 - 2 * 0.2, 1 - 2 * 0.1, 0.0, 0.0, 1.0, 1 - 2 * 0.095], abs=1e-6)


def test_proximity_from_scan_is_zero_beyond_range_and_45_degrees():
    far = np.full(360, 0.105 + 0.41)
    assert not near().value(received(independent.laser_scan(far))).any()
    spec = ProximitySpec(angles_deg=(0.0,), range_m=0.4, response=proximity_of(body()).response)
    alone = LaserAsProximity(spec, 0.105, 0.0, 0.0)
    ranges = np.full(360, inf)
    ranges[46:315] = 0.2
    assert alone.value(received(independent.laser_scan(ranges))) == pytest.approx([0.0])
    ranges[44] = 0.2
    assert alone.value(received(independent.laser_scan(ranges))) == pytest.approx([1 - 2 * 0.095], abs=1e-6)


@given(st.floats(-0.1, 0.1), st.floats(-pi, pi), st.floats(0.0, 0.3), st.floats(-pi, pi))
def test_proximity_from_scan_is_measured_from_the_rim(at_m, angle_rad, away_m, mounted_rad):
    """A thing `away_m` from the rim along a ray of a scanner that stands `at_m` ahead of the centre."""
    low, high = 0.0, 1.0
    for _ in range(60):  # where the ray leaves the disc, by halving
        half = 0.5 * (low + high)
        inside = hypot(at_m + half * cos(angle_rad), half * sin(angle_rad)) < 0.105
        low, high = (half, high) if inside else (low, half)
    spec = ProximitySpec(angles_deg=(np.rad2deg(angle_rad),), range_m=0.4, response=proximity_of(body()).response)
    message = received(independent.laser_scan([low + away_m], angle_rad - mounted_rad, 0.1, range_min=0.0))
    value = LaserAsProximity(spec, 0.105, at_m, mounted_rad).value(message)
    assert value == pytest.approx([1.0 - 2.0 * away_m], abs=1e-5)


def test_scan_with_a_signalling_nan_has_no_return():
    signalling = np.frombuffer(bytes.fromhex("0100807f"), np.float32)
    message = SimpleNamespace(ranges=signalling, range_min=0.1, range_max=3.0)
    assert returns_m(message).tolist() == [inf]


def followed(travel: WheelTravel, message: independent.Odometry) -> tuple[float, float]:
    travel.add(MESSAGES.decode(ODOMETRY, message.serialize()))
    return travel.left_m, travel.right_m


def turned(yaw_rad: float) -> Quaternion:
    return Quaternion(z=float(np.sin(yaw_rad / 2)), w=float(np.cos(yaw_rad / 2)))


@given(STEPS)
def test_wheel_travel_survives_as_a_pose(steps):
    poses, travel = WheelPoses(1, BASE_M, OdometrySpec()), WheelTravel(BASE_M, MAX_MPS)
    rolled_m, theirs = np.zeros(2), odometry(0.0, 0.0, Quaternion(), 0)
    for tick, step in enumerate([(0.0, 0.0), *steps]):
        rolled_m = rolled_m + step
        poses.add(tick * TICK_NS, rolled_m[:1], rolled_m[1:])
        theirs = independent.Odometry.deserialize(MESSAGES.encode(ODOMETRY, poses.message(MESSAGES, 0, tick * TICK_NS)))
        assert followed(travel, theirs) == pytest.approx(tuple(rolled_m), abs=1e-9)
    assert theirs.twist.twist.linear.x == pytest.approx(sum(steps[-1]) / 2 / 0.1, abs=1e-9)
    assert theirs.twist.twist.angular.z == pytest.approx((steps[-1][1] - steps[-1][0]) / BASE_M / 0.1, abs=1e-9)
    assert travel.jumps == 0


def test_wheel_travel_adds_up_across_the_yaw_seam_and_backwards():
    travel = WheelTravel(BASE_M, MAX_MPS)
    for tick in range(101):
        followed(travel, odometry(0.0, 0.0, turned(tick * 0.2 * pi), tick * TICK_NS))
    assert (travel.left_m, travel.right_m) == pytest.approx((-20 * pi * BASE_M / 2, 20 * pi * BASE_M / 2))
    travel, back = WheelTravel(BASE_M, MAX_MPS), -0.02
    followed(travel, odometry(0.0, 0.0, turned(3.0), 0))
    travelled_m = followed(travel, odometry(back * np.cos(3.0), back * np.sin(3.0), turned(3.0), TICK_NS))
    assert travelled_m == pytest.approx((back, back))


def test_wheel_travel_skips_and_counts_pose_jumps():
    travel = WheelTravel(BASE_M, MAX_MPS)
    followed(travel, odometry(5.0, 5.0, turned(0.0), 0))
    assert followed(travel, odometry(0.0, 0.0, turned(0.0), TICK_NS)) == (0.0, 0.0)  # it was switched on anew
    assert travel.jumps == 1
    assert followed(travel, odometry(0.02, 0.0, turned(0.0), 2 * TICK_NS)) == pytest.approx((0.02, 0.02))


@pytest.mark.parametrize("pose", [(nan, 0.0, turned(0.0)), (0.0, nan, turned(0.0)), (0.0, 0.0, Quaternion(w=0.0))])
def test_wheel_travel_refuses_a_pose_that_is_not_finite(pose):
    travel = WheelTravel(BASE_M, MAX_MPS)
    followed(travel, odometry(0.0, 0.0, turned(0.0), 0))
    with pytest.raises(BadFrame):
        followed(travel, odometry(*pose, TICK_NS))
    assert followed(travel, odometry(0.01, 0.0, turned(0.0), 2 * TICK_NS)) == pytest.approx((0.01, 0.01))


def test_wheel_poses_add_travel_after_a_gap():
    poses = WheelPoses(2, BASE_M, OdometrySpec())
    for tick, left_m in enumerate(([0.0, nan], [0.1, nan], [nan, 0.2], [0.3, 0.3])):
        poses.add(tick * TICK_NS, np.array(left_m), np.array(left_m))
    assert poses.pose == pytest.approx(np.array([[0.3, 0.0, 0.0], [0.3, 0.0, 0.0]]))


@pytest.mark.parametrize(
    ("spec", "axes"),
    [
        (OdometrySpec(slip=0.2), [0, 1, 2]),
        (OdometrySpec(wheel_error_std=0.02), [0, 1, 2]),
        (OdometrySpec(step_m=0.001), [2]),  # of the place the rounding is second to the drift of the heading
    ],
    ids=["slip", "sizes", "steps"],
)
def test_odometry_covariance_of_wheels_matches_a_monte_carlo(spec, axes):
    bases, wheels, keys = 1500, np.arange(2), np.uint64(5)
    rows = np.arange(bases)[:, None]
    poses, exact = WheelPoses(bases, BASE_M, spec), WheelPoses(bases, BASE_M, OdometrySpec())
    step_m = np.array([0.01, 0.014]) * (0.9 + 0.2 * uniform(keys, rows, 0, wheels, purpose("speed")))
    sizes = 1.0 + spec.wheel_error_std * normal(keys, rows, 0, wheels, purpose("size"))
    measured_m = np.zeros((bases, 2))
    for tick in range(1, 31):  # 0.36 m along an arc of 0.75 rad
        measured_m += step_m * sizes * (1.0 + spec.slip * normal(keys, rows, tick, wheels, purpose("slip")))
        shown_m = np.floor(measured_m / spec.step_m) * spec.step_m if spec.step_m else measured_m
        poses.add(tick * TICK_NS, *shown_m.T.copy())
        exact.add(tick * TICK_NS, *(tick * step_m).T.copy())
    # Of 1,500 draws a variance is within 18 % of its own: five standard errors.
    predicted, among = poses.covariance.pose.mean(axis=0), np.cov((poses.pose - exact.pose).T)
    assert np.diag(predicted)[axes] == pytest.approx(np.diag(among)[axes], rel=0.2)
    if len(axes) == 3:
        assert predicted[1, 2] == pytest.approx(among[1, 2], rel=0.2)
    twist = np.cov((poses.speed - exact.speed).T)
    assert np.diag(poses.covariance.twist.mean(axis=0)) == pytest.approx(np.diag(twist), rel=0.2)


def test_odometry_covariance_by_hand():
    # One arc of 0.1 m straight on with 10 % of slip: each wheel errs by 0.01 m.
    poses = WheelPoses(1, BASE_M, OdometrySpec(slip=0.1))
    poses.add(TICK_NS, np.array([0.1]), np.array([0.1]))
    theirs = sent(ODOMETRY, poses.message(MESSAGES, 0, 0))
    pose, twist = (np.reshape(part.covariance, (6, 6)) for part in (theirs.pose, theirs.twist))
    turn = 2.0 * 0.01**2 / BASE_M**2
    assert pose[0, 0] == pytest.approx(0.01**2 / 2)
    assert (pose[1, 1], pose[1, 5], pose[5, 5]) == pytest.approx((0.05**2 * turn, 0.05 * turn, turn))
    assert (twist[0, 0], twist[1, 1], twist[5, 5]) == pytest.approx((0.005, 0.005, turn / 0.1**2))
    assert pose[2, 2] == pose[3, 3] == twist[2, 2] == 1e6  # not measured


def test_odometry_covariance_without_errors_is_positive():
    theirs = sent(ODOMETRY, WheelPoses(1, BASE_M, OdometrySpec()).message(MESSAGES, 0, 0))
    assert np.linalg.eigvalsh(np.reshape(theirs.pose.covariance, (6, 6))).min() == pytest.approx(1e-9)


def sent(kind, message):
    return independent.BY_KIND[kind].deserialize(MESSAGES.encode(kind, message))


def received_reading(kind, message):
    return MESSAGES.decode(kind, message.serialize())


@given(VALUES, VALUES, VALUES, st.floats(-3.1, 3.1), st.floats(-360.0, 360.0))
def test_imu_motion_survives(forward, left, turn, heading, north_deg):
    theirs = sent(IMU, imu(MESSAGES, Motion(forward, left, turn, heading), north_deg, 0))
    assert theirs.linear_acceleration.z == pytest.approx(9.80665)
    back = motion_of(received_reading(IMU, theirs), north_deg)
    assert back[:3] == (forward, left, turn)
    assert back.heading_rad == pytest.approx(heading, abs=1e-9)


def test_imu_quantities_not_measured_are_nan():
    for kind in range(3):
        motion = Motion(*(1.0 if kind == 0 else nan,) * 2, 2.0 if kind == 1 else nan, 0.5 if kind == 2 else nan)
        theirs = sent(IMU, imu(MESSAGES, motion, 0.0, 0))
        names = ("linear_acceleration", "angular_velocity", "orientation")
        assert [getattr(theirs, f"{name}_covariance")[0] == -1.0 for name in names] == [kind != k for k in range(3)]
        assert motion_of(received_reading(IMU, theirs), 0.0) == pytest.approx(motion, nan_ok=True)


def test_imu_covariance_is_noise_plus_constant_bias():
    inertial = {"noise_mps2": 0.3, "bias_std_mps2": 0.4, "noise_radps": 0.1, "bias_std_radps": 0.0}
    sheet = body_from({"like": "turtlebot3-burger", "sensors": {"imu": inertial, "compass": {"noise_rad": 0.0}}}, "b")
    theirs = sent(IMU, imu(MESSAGES, Motion(1.0, 2.0, 3.0, 0.5), 0.0, 0, motion_variance(sheet)))
    assert theirs.linear_acceleration_covariance == pytest.approx((0.25 * np.eye(3)).ravel())
    assert theirs.angular_velocity_covariance == pytest.approx((0.01 * np.eye(3)).ravel())
    assert theirs.orientation_covariance == pytest.approx((1e-9 * np.eye(3)).ravel())  # 0 would be: not known


def test_imu_and_compass_share_messages_at_equal_times():
    assert motion_sensors(load_body("turtlebot3-burger")) == [("imu", "compass")]
    late = body_from({"like": "turtlebot3-burger", "sensors": {"compass": {"delay_s": 0.2}}}, "late")
    assert motion_sensors(late) == [("imu",), ("compass",)]
    apart = ImuReader(0.0, is_apart=True)
    for motion in (Motion(1.0, 2.0, 3.0), Motion(heading_rad=0.5)):
        apart.read(received_reading(IMU, sent(IMU, imu(MESSAGES, motion, 0.0, 0))))
    assert {name: float(value[0]) for name, value in apart.fields.items()} == pytest.approx(
        {"imu.forward_mps2": 1.0, "imu.left_mps2": 2.0, "imu.turn_radps": 3.0, "compass.heading_rad": 0.5}
    )


def battery() -> BatterySpec:
    spec = load_body("turtlebot3-burger").sensors["battery"]
    assert isinstance(spec, BatterySpec)
    return spec


@pytest.mark.parametrize(
    ("percentage", "voltage_v", "charge"),
    [
        *((0.4, 11.0, 0.4), (nan, 9.9, 0.0), (nan, 12.6, 1.0), (nan, 11.25, 0.5), (40.0, 11.25, 0.5)),
        *((nan, 14.0, 1.0), (nan, nan, nan)),
    ],
)
def test_battery_charge_is_the_percentage_or_from_voltage(percentage, voltage_v, charge):
    theirs = sent(BATTERY_STATE, battery_state(MESSAGES, percentage, voltage_v, 0))
    assert (theirs.percentage, theirs.voltage) == pytest.approx((percentage, voltage_v), nan_ok=True)
    assert theirs.present
    read = charge_of(received_reading(BATTERY_STATE, theirs), battery())
    assert read == pytest.approx(charge, abs=1e-6, nan_ok=True)


@pytest.mark.parametrize(
    ("lux", "value"), [(0.0, 0.0), (400.0, 0.5), (800.0, 1.0), (9e9, 1.0), (-1.0, 0.0), (nan, 0.0)]
)
def test_illuminance_reads_one_at_full_lux(lux, value):
    message = independent.Illuminance(independent.header(), lux, 0.0)
    assert brightness_of(received_reading(ILLUMINANCE, message), 800.0) == value


@pytest.mark.parametrize(("value", "distance_m"), [(0.0, inf), (0.1, inf), (0.104, inf), (0.12, 0.44), (1.0, 0.0)])
def test_range_is_the_distance_of_a_reading_above_the_noise(value, distance_m):
    extra = {"angles_deg": [0], "range_m": 0.5, "response": LINEAR, "noise": 0.1, "step": 0.01}
    sheet = body_from({"like": "turtlebot3-burger", "sensors": {"proximity": extra}}, "b")
    message = proximity_range(MESSAGES, proximity_of(sheet), value, "proximity_0", 0)
    assert (message.range, message.max_range) == pytest.approx((distance_m, 0.5))
