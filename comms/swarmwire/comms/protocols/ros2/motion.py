"""Motion of a base in ROS 2 messages: yaw, Odometry from and to wheel travel, JointState of its wheels, and Imu.

`WheelPoses` integrates wheel travel into the poses that an emulated base sends. `WheelTravel` does the reverse for the
poses of a real base.
"""

from math import cos, hypot, isfinite, isnan, nan, radians, sin
from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms.base.angles import wrap_angle
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.clock import to_s
from swarmwire.comms.base.errors import BadFrame
from swarmwire.comms.base.math import atan2
from swarmwire.comms.protocols.ros2.covariance import WheelCovariance, variance_of
from swarmwire.comms.protocols.ros2.keys import IMU, JOINT_STATE, ODOMETRY
from swarmwire.comms.protocols.ros2.messages import Messages, Velocities, stamp_ns
from swarmwire.comms.robot.bodies.body import Body
from swarmwire.comms.robot.bodies.drives import twist_of_wheels, wheels_of_twist
from swarmwire.comms.robot.bodies.ros2_names import Ros2Names
from swarmwire.comms.robot.sensors.simple import OdometrySpec

ODOMETRY_FRAME, CHILD_FRAME, BASE_FRAME, IMU_FRAME = "odom", "base_footprint", "base_link", "imu_link"
# A pose that is further away than this margin plus this multiple of the base's largest speed is a jump.
JUMP_MARGIN_M, JUMP_FACTOR = 0.1, 2.0
STRAIGHT_RAD = 1e-6  # below this turn an arc is as long as its chord
GRAVITY_MPS2 = 9.80665  # upward acceleration that an accelerometer at rest measures

Pose = tuple[float, float, float]


def yaw_of(quaternion: Any) -> float:
    """Return the yaw of a quaternion of any length in rad, in [-pi, pi]; nan for length 0.

    It is the yaw of roll, pitch and yaw about fixed axes (tf2: impl/utils.hpp, getYaw). Within 0.3 degrees of a pitch
    of 90 degrees, where tf2 sets the roll to 0, it may differ from tf2's.
    """
    x, y, z, w = (float(part) for part in (quaternion.x, quaternion.y, quaternion.z, quaternion.w))
    if not x * x + y * y + z * z + w * w > 0.0:
        return float("nan")
    return atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)


def quaternion(messages: Messages, yaw_rad: float) -> Any:
    """Return the quaternion of a yaw."""
    return messages.make("geometry_msgs/msg/Quaternion", 0.0, 0.0, sin(0.5 * yaw_rad), cos(0.5 * yaw_rad))


class FramePose(NamedTuple):
    """Pose of a frame in its parent frame."""

    parent: str
    name: str
    x_m: float = 0.0
    y_m: float = 0.0
    yaw_rad: float = 0.0
    z_m: float = 0.0


def odometry_frame(x_m: float, y_m: float, yaw_rad: float) -> FramePose:
    """Return the frame of the base at its pose by the wheels."""
    return FramePose(ODOMETRY_FRAME, CHILD_FRAME, x_m, y_m, wrap_angle(yaw_rad))


def odometry(
    messages: Messages,
    frame: FramePose,
    velocities: Velocities,
    covariances: tuple[FloatArray, FloatArray],
    stamp_ns: int,
) -> Any:
    """Return the Odometry of a base: its frame, velocities in it, and the covariances (36,) of pose and twist."""
    make = messages.make
    position = make("geometry_msgs/msg/Point", frame.x_m, frame.y_m, frame.z_m)
    pose = make("geometry_msgs/msg/Pose", position, quaternion(messages, frame.yaw_rad))
    linear = make("geometry_msgs/msg/Vector3", velocities.linear_mps, velocities.lateral_mps, 0.0)
    angular = make("geometry_msgs/msg/Vector3", 0.0, 0.0, velocities.angular_radps)
    return make(
        ODOMETRY,
        messages.header(stamp_ns, frame.parent),
        frame.name,
        make("geometry_msgs/msg/PoseWithCovariance", pose, covariances[0]),
        make("geometry_msgs/msg/TwistWithCovariance", make("geometry_msgs/msg/Twist", linear, angular), covariances[1]),
    )


class WheelPoses:
    """Poses of n bases from their wheel travel, starting at the origin; a base drives an arc between two readings.

    Attributes:
        pose: (n, 3) x and y in m, turn since the start in rad, not wrapped.
        speed: (n, 2) in m/s and rad/s, between the last two readings.
        travel_m: (n, 2) travel of the left and right wheel since the start.
        wheel_mps: (n, 2) speeds of these wheels, between the last two readings.
        covariance: covariance of pose and speed, from the errors in the spec of the encoders.
    """

    def __init__(self, bases: int, wheel_base_m: float, spec: OdometrySpec) -> None:
        self.pose, self.speed = np.zeros((bases, 3)), np.zeros((bases, 2))
        self.travel_m, self.wheel_mps = np.zeros((bases, 2)), np.zeros((bases, 2))
        self.covariance = WheelCovariance(bases, wheel_base_m, spec)
        self._wheel_base_m, self._before_ns = wheel_base_m, 0

    def add(self, time_ns: int, left_m: FloatArray, right_m: FloatArray) -> None:
        """Add the travel (n,) of both wheels since the last reading; nan travel is added with the next valid one."""
        travel_m = np.stack([left_m, right_m], axis=1)
        travel_m = np.where(np.isnan(travel_m), self.travel_m, travel_m)
        step_m, duration_s = travel_m - self.travel_m, to_s(time_ns - self._before_ns)
        self._before_ns, self.travel_m = time_ns, travel_m
        arc_m, turn_rad = twist_of_wheels(step_m[:, 0], step_m[:, 1], self._wheel_base_m)
        chord_m = arc_m * np.sinc(turn_rad / (2.0 * np.pi))
        course_rad = self.pose[:, 2] + 0.5 * turn_rad
        self.pose += np.stack([chord_m * np.cos(course_rad), chord_m * np.sin(course_rad), turn_rad], axis=1)
        self.covariance.add(course_rad, chord_m, step_m, duration_s)
        if duration_s > 0.0:
            self.speed = np.stack([arc_m, turn_rad], axis=1) / duration_s
            self.wheel_mps = step_m / duration_s

    def message(self, messages: Messages, base: int, stamp_ns: int) -> Any:
        """Return the Odometry message of a base."""
        x_m, y_m, turn_rad = map(float, self.pose[base])
        linear_mps, angular_radps = map(float, self.speed[base])
        return odometry(
            messages,
            odometry_frame(x_m, y_m, turn_rad),
            Velocities(linear_mps, angular_radps),
            (self.covariance.pose_matrix(base), self.covariance.twist_matrix(base)),
            stamp_ns,
        )


def joint_state(
    messages: Messages, names: Ros2Names, travel_m: FloatArray, speed_mps: FloatArray, radius_m: float, stamp_ns: int
) -> Any:
    """Return the JointState of wheels of this radius, from travel and speeds at their rims (2,): left, right."""
    return messages.make(
        JOINT_STATE,
        messages.header(stamp_ns, BASE_FRAME),
        [names.left_joint, names.right_joint],
        travel_m / radius_m,
        speed_mps / radius_m,
        np.empty(0),  # no effort is measured
    )


class WheelTravel:
    """Travel of both wheels of a base since the first message, from the poses in its Odometry messages.

    Between two poses the base drives an arc: with chord c and turn a, its length is c (a / 2) / sin(a / 2), positive if
    the chord points ahead at the heading half way. The wheels roll that length -+ a times half the wheel base.

    Attributes:
        left_m: travel of the left wheel.
        right_m: travel of the right wheel.
        jumps: number of poses further away than the base can drive; their distance is not added.
    """

    def __init__(self, wheel_base_m: float, max_linear_mps: float) -> None:
        self.left_m = self.right_m = 0.0
        self.jumps = 0
        self._wheel_base_m, self._max_mps = wheel_base_m, max_linear_mps
        self._last: tuple[int, Pose] | None = None

    def add(self, message: Any) -> None:
        """Add an Odometry message, later than the previous one; BadFrame if its pose is not finite."""
        pose, time_ns = message.pose.pose, stamp_ns(message.header)
        x_m, y_m, yaw_rad = pose.position.x, pose.position.y, yaw_of(pose.orientation)
        if not (isfinite(x_m) and isfinite(y_m) and isfinite(yaw_rad)):
            raise BadFrame("malformed", "a pose that is not finite")
        if self._last is not None:
            last_ns, (last_x_m, last_y_m, last_yaw_rad) = self._last
            step = x_m - last_x_m, y_m - last_y_m, yaw_rad - last_yaw_rad
            self._add_step(step, last_yaw_rad, to_s(time_ns - last_ns))
        self._last = time_ns, (x_m, y_m, yaw_rad)

    def _add_step(self, step: Pose, yaw_rad: float, duration_s: float) -> None:
        """Add the arc between a pose of this yaw and the next pose, unless it is a jump."""
        chord_m, turn_rad = hypot(step[0], step[1]), wrap_angle(step[2])
        if chord_m > JUMP_FACTOR * self._max_mps * max(duration_s, 0.0) + JUMP_MARGIN_M:
            self.jumps += 1
            return
        half_rad = 0.5 * turn_rad
        ahead = step[0] * cos(yaw_rad + half_rad) + step[1] * sin(yaw_rad + half_rad)
        arc_m = chord_m * (half_rad / sin(half_rad) if abs(half_rad) > STRAIGHT_RAD else 1.0)
        arc_m = arc_m if ahead >= 0.0 else -arc_m
        left_m, right_m = wheels_of_twist(arc_m, turn_rad, self._wheel_base_m)
        self.left_m, self.right_m = self.left_m + left_m, self.right_m + right_m


class Motion(NamedTuple):
    """Values of an Imu message for a base on a level floor, in the frame of the base; nan: not measured."""

    forward_mps2: float = nan
    left_mps2: float = nan
    turn_radps: float = nan
    heading_rad: float = nan  # (-pi, pi]


class MotionVariance(NamedTuple):
    """Variances of a motion; 0 means unknown, by the definition of the message."""

    acceleration: float = 0.0
    turn: float = 0.0
    heading: float = 0.0


UNKNOWN_VARIANCE = MotionVariance()


def motion_variance(body: Body) -> MotionVariance:
    """Return the variances of the data sheet: noise and constant bias, without the drift of the bias."""
    inertial, compass = body.imu, body.compass
    heading = variance_of(compass.noise_rad, step=compass.step) if compass else 0.0
    if inertial is None:
        return MotionVariance(heading=heading)
    acceleration = variance_of(inertial.noise_mps2, inertial.bias_std_mps2, step=inertial.step)
    turn = variance_of(inertial.noise_radps, inertial.bias_std_radps, step=inertial.step)
    return MotionVariance(acceleration, turn, heading)


def motion_sensors(body: Body) -> list[tuple[str, ...]]:
    """Return the sensors of each Imu topic: `imu` and `compass` share one if they measure at the same times.

    A message has one time.
    """
    sensors = [name for name in ("imu", "compass") if name in body.sensors]
    times = {(body.sensors[name].rate_hz, body.sensors[name].delay_s) for name in sensors}
    return [tuple(sensors)] if len(times) == 1 else [(name,) for name in sensors]


def motion_of(message: Any, north_deg: float) -> Motion:
    """Return the motion in a message; the heading is its yaw turned by `north_deg`.

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
    messages: Messages, motion: Motion, north_deg: float, stamp_ns: int, variance: MotionVariance = UNKNOWN_VARIANCE
) -> Any:
    """Return the message of a motion; nan values are marked as not measured."""
    make = messages.make
    has_acceleration = not isnan(motion.forward_mps2 + motion.left_mps2)
    turn_radps, heading_rad = motion.turn_radps, motion.heading_rad
    yaw_rad = 0.0 if isnan(heading_rad) else wrap_angle(heading_rad - radians(north_deg))
    forward_mps2, left_mps2 = (motion.forward_mps2, motion.left_mps2) if has_acceleration else (0.0, 0.0)
    return make(
        IMU,
        messages.header(stamp_ns, IMU_FRAME),
        quaternion(messages, yaw_rad),
        _covariance(variance.heading, measured=not isnan(heading_rad)),
        make("geometry_msgs/msg/Vector3", 0.0, 0.0, 0.0 if isnan(turn_radps) else turn_radps),
        _covariance(variance.turn, measured=not isnan(turn_radps)),
        make("geometry_msgs/msg/Vector3", forward_mps2, left_mps2, GRAVITY_MPS2),
        _covariance(variance.acceleration, measured=has_acceleration),
    )


def _covariance(variance: float, *, measured: bool) -> FloatArray:
    """Return a covariance (9,) with equal variances about all axes; its first element is -1 if not measured."""
    covariance = variance * np.eye(3).ravel()
    if not measured:
        covariance[0] = -1.0
    return covariance
