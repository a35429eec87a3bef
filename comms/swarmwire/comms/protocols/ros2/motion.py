"""Motion of a base in ROS 2 messages: yaw, Odometry from and to wheel travel, JointState of its wheels, and Imu.

`WheelPoses` integrates wheel travel into the poses that an emulated base sends. `WheelTravel` does the reverse for the
poses of a real base.
"""

from math import atan2, cos, hypot, isfinite, isnan, nan, radians, sin
from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms.base.angles import wrap_angle
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.clock import to_s
from swarmwire.comms.base.errors import BadFrame
from swarmwire.comms.protocols.ros2.covariance import WheelCovariance, variance_of
from swarmwire.comms.protocols.ros2.keys import IMU, JOINT_STATE, ODOMETRY
from swarmwire.comms.protocols.ros2.messages import Messages, stamp_ns
from swarmwire.comms.robot.bodies.body import Body
from swarmwire.comms.robot.bodies.drives import twist_of_wheels, wheels_of_twist
from swarmwire.comms.robot.bodies.ros2_names import Ros2Names
from swarmwire.comms.robot.sensors.simple import OdometrySpec

ODOMETRY_FRAME, CHILD_FRAME, BASE_FRAME, IMU_FRAME = "odom", "base_footprint", "base_link", "imu_link"
# A measured pose may be further on by this margin, and by this multiple of the base's largest speed; more is a jump.
JUMP_MARGIN_M, JUMP_FACTOR = 0.1, 2.0
STRAIGHT_RAD = 1e-6  # below this turn an arc is as long as its chord
GRAVITY_MPS2 = 9.80665  # upward acceleration that an accelerometer at rest measures

Pose = tuple[float, float, float]


def yaw_of(quaternion: Any) -> float:
    """The yaw of a quaternion in rad, in [-pi, pi]; nan for a quaternion of length 0."""
    x, y, z, w = quaternion.x, quaternion.y, quaternion.z, quaternion.w
    if not x * x + y * y + z * z + w * w > 0.0:
        return float("nan")
    return atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)


def quaternion(messages: Messages, yaw_rad: float) -> Any:
    """The quaternion of a yaw."""
    return messages.make("geometry_msgs/msg/Quaternion", 0.0, 0.0, sin(0.5 * yaw_rad), cos(0.5 * yaw_rad))


class WheelPoses:
    """The poses of n bases by their wheel travel, from the origin; between two readings a base drives an arc.

    Attributes:
        pose: (n, 3) x and y in m, turn since the start in rad, which is not wrapped.
        speed: (n, 2) in m/s and rad/s, between the last two readings.
        travel_m: (n, 2) of the left and the right wheel since the start.
        wheel_mps: (n, 2) speeds of these wheels, between the last two readings.
        covariance: of pose and speed, by the errors in the spec of the encoders.
    """

    def __init__(self, bases: int, wheel_base_m: float, spec: OdometrySpec) -> None:
        self.pose, self.speed = np.zeros((bases, 3)), np.zeros((bases, 2))
        self.travel_m, self.wheel_mps = np.zeros((bases, 2)), np.zeros((bases, 2))
        self.covariance = WheelCovariance(bases, wheel_base_m, spec)
        self._wheel_base_m, self._before_ns = wheel_base_m, 0

    def follow(self, time_ns: int, left_m: FloatArray, right_m: FloatArray) -> None:
        """Add the travel (n,) of both wheels since the last reading; nan travel is added with the next valid one."""
        travel_m = np.stack([left_m, right_m], axis=1)
        travel_m = np.where(np.isnan(travel_m), self.travel_m, travel_m)
        by_m, for_ns = travel_m - self.travel_m, time_ns - self._before_ns
        self._before_ns, self.travel_m = time_ns, travel_m
        arc_m, turn_rad = twist_of_wheels(by_m[:, 0], by_m[:, 1], self._wheel_base_m)
        chord_m = arc_m * np.sinc(turn_rad / (2.0 * np.pi))
        course_rad = self.pose[:, 2] + 0.5 * turn_rad
        self.pose += np.stack([chord_m * np.cos(course_rad), chord_m * np.sin(course_rad), turn_rad], axis=1)
        self.covariance.follow(course_rad, chord_m, by_m, to_s(for_ns))
        if for_ns > 0:
            self.speed = np.stack([arc_m, turn_rad], axis=1) / to_s(for_ns)
            self.wheel_mps = by_m / to_s(for_ns)

    def message(self, messages: Messages, base: int, stamp_ns: int) -> Any:
        """The Odometry message of one base."""
        x_m, y_m, turn_rad = map(float, self.pose[base])
        linear_mps, angular_radps = map(float, self.speed[base])
        make = messages.make
        place = make("geometry_msgs/msg/Point", x_m, y_m, 0.0)
        pose = make("geometry_msgs/msg/Pose", place, quaternion(messages, wrap_angle(turn_rad)))
        linear = make("geometry_msgs/msg/Vector3", linear_mps, 0.0, 0.0)
        angular = make("geometry_msgs/msg/Vector3", 0.0, 0.0, angular_radps)
        twist = make("geometry_msgs/msg/Twist", linear, angular)
        return make(
            ODOMETRY,
            messages.header(stamp_ns, ODOMETRY_FRAME),
            CHILD_FRAME,
            make("geometry_msgs/msg/PoseWithCovariance", pose, self.covariance.pose_matrix(base)),
            make("geometry_msgs/msg/TwistWithCovariance", twist, self.covariance.twist_matrix(base)),
        )


def joint_state(
    messages: Messages, names: Ros2Names, travel_m: FloatArray, speed_mps: FloatArray, radius_m: float, stamp_ns: int
) -> Any:
    """The angles and speeds of wheels of this radius with this travel and these speeds at the rim (2,), left, right."""
    return messages.make(
        JOINT_STATE,
        messages.header(stamp_ns, BASE_FRAME),
        [names.left_joint, names.right_joint],
        travel_m / radius_m,
        speed_mps / radius_m,
        np.empty(0),  # no effort is measured
    )


class WheelTravel:
    """The travel of both wheels of a base since the first message, from the poses in its Odometry messages.

    Between two poses the base drives an arc: with chord c and turn a it is c (a / 2) / sin(a / 2) long, forwards or
    backwards as the chord lies to the heading half way. The wheels roll that length -+ a times half the wheel base.

    Attributes:
        left_m: travelled by the left wheel.
        right_m: travelled by the right wheel.
        jumps: number of poses further away than the base can drive; the travel continues from there.
    """

    def __init__(self, wheel_base_m: float, max_linear_mps: float) -> None:
        self.left_m = self.right_m = 0.0
        self.jumps = 0
        self._wheel_base_m, self._max_mps = wheel_base_m, max_linear_mps
        self._last: tuple[int, Pose] | None = None

    def follow(self, message: Any) -> None:
        """Add an Odometry message, later than the last one; BadFrame if its pose is not finite."""
        pose, at = message.pose.pose, stamp_ns(message.header)
        x_m, y_m, yaw_rad = pose.position.x, pose.position.y, yaw_of(pose.orientation)
        if not (isfinite(x_m) and isfinite(y_m) and isfinite(yaw_rad)):
            raise BadFrame("malformed", "a pose that is not finite")
        if self._last is not None:
            before_ns, before = self._last
            self._add((x_m - before[0], y_m - before[1], yaw_rad - before[2]), before[2], to_s(at - before_ns))
        self._last = at, (x_m, y_m, yaw_rad)

    def _add(self, by: Pose, yaw_rad: float, for_s: float) -> None:
        chord_m, turn_rad = hypot(by[0], by[1]), wrap_angle(by[2])
        if chord_m > JUMP_FACTOR * self._max_mps * max(for_s, 0.0) + JUMP_MARGIN_M:
            self.jumps += 1
            return
        half_rad = 0.5 * turn_rad
        ahead = by[0] * cos(yaw_rad + half_rad) + by[1] * sin(yaw_rad + half_rad)
        arc_m = chord_m * (half_rad / sin(half_rad) if abs(half_rad) > STRAIGHT_RAD else 1.0)
        arc_m = arc_m if ahead >= 0.0 else -arc_m
        left_m, right_m = wheels_of_twist(arc_m, turn_rad, self._wheel_base_m)
        self.left_m, self.right_m = self.left_m + left_m, self.right_m + right_m


class Motion(NamedTuple):
    """The values of an Imu message for a base on a level floor, in the frame of the base; nan: not measured."""

    forward_mps2: float = nan
    left_mps2: float = nan
    turn_radps: float = nan
    heading_rad: float = nan  # in (-pi, pi]


class MotionVariance(NamedTuple):
    """The variances of a motion; by the definition of the message 0: not known."""

    acceleration: float = 0.0
    turn: float = 0.0
    heading: float = 0.0


NOT_KNOWN = MotionVariance()


def motion_variance(body: Body) -> MotionVariance:
    """By the data sheet: noise and constant bias; the drift of the bias is not in it."""
    inertial, compass = body.imu, body.compass
    heading = variance_of(compass.noise_rad, step=compass.step) if compass else 0.0
    if inertial is None:
        return MotionVariance(heading=heading)
    acceleration = variance_of(inertial.noise_mps2, inertial.bias_std_mps2, step=inertial.step)
    turn = variance_of(inertial.noise_radps, inertial.bias_std_radps, step=inertial.step)
    return MotionVariance(acceleration, turn, heading)


def motion_sensors(body: Body) -> list[tuple[str, ...]]:
    """Which of `imu` and `compass` share messages: both if they measure at the same times, since a message has one."""
    sensors = [name for name in ("imu", "compass") if name in body.sensors]
    times = {(body.sensors[name].rate_hz, body.sensors[name].delay_s) for name in sensors}
    return [tuple(sensors)] if len(times) == 1 else [(name,) for name in sensors]


def motion_of(message: Any, north_deg: float) -> Motion:
    """The motion in a message; the heading is its yaw turned by `north_deg`.

    By the message's definition, a first covariance of -1 means that orientation, turn rate or acceleration is not
    measured.
    """
    turn, acceleration = message.angular_velocity, message.linear_acceleration
    has_acceleration = message.linear_acceleration_covariance[0] != -1.0
    yaw_rad = yaw_of(message.orientation) if message.orientation_covariance[0] != -1.0 else nan
    return Motion(
        acceleration.x if has_acceleration else nan,
        acceleration.y if has_acceleration else nan,
        turn.z if message.angular_velocity_covariance[0] != -1.0 else nan,
        wrap_angle(yaw_rad + radians(north_deg)) if not isnan(yaw_rad) else nan,
    )


def imu(
    messages: Messages, motion: Motion, north_deg: float, stamp_ns: int, variance: MotionVariance = NOT_KNOWN
) -> Any:
    """The message of a motion; nan values are marked as not measured."""
    make = messages.make
    known = not isnan(motion.forward_mps2 + motion.left_mps2)
    turn_radps, heading_rad = motion.turn_radps, motion.heading_rad
    yaw_rad = 0.0 if isnan(heading_rad) else wrap_angle(heading_rad - radians(north_deg))
    forward_mps2, left_mps2 = (motion.forward_mps2, motion.left_mps2) if known else (0.0, 0.0)
    return make(
        IMU,
        messages.header(stamp_ns, IMU_FRAME),
        quaternion(messages, yaw_rad),
        _covariance(variance.heading, measured=not isnan(heading_rad)),
        make("geometry_msgs/msg/Vector3", 0.0, 0.0, 0.0 if isnan(turn_radps) else turn_radps),
        _covariance(variance.turn, measured=not isnan(turn_radps)),
        make("geometry_msgs/msg/Vector3", forward_mps2, left_mps2, GRAVITY_MPS2),
        _covariance(variance.acceleration, measured=known),
    )


def _covariance(variance: float, *, measured: bool) -> FloatArray:
    """The same variance about each axis, (9,); with the first element -1 if it is not measured."""
    covariance = variance * np.eye(3).ravel()
    if not measured:
        covariance[0] = -1.0
    return covariance
