"""Covariances in ROS 2 messages: of poses and twists from the errors of wheel encoders, and of an IMU's readings.

The covariance of a pose grows as in Siegwart and Nourbakhsh, Introduction to Autonomous Mobile Robots, section 5.2.4:
with F the derivative of the new pose by the old pose, and G its derivative by the travel of both wheels,

    P <- F P F^T + G diag(slip^2 d_left^2, slip^2 d_right^2) G^T

An error of a wheel's size always has the same direction, so its share is that of a constant parameter: J <- F J +
G diag(d_left, d_right), and J J^T wheel_error_std^2. Rounding to encoder steps does not add up. Wheels that slide, such
as those of a robot that is pushed, are not modelled.
"""

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.robot.sensors.simple import OdometrySpec

UNMEASURED = 1e6  # variance of z, roll and pitch, which wheels do not measure (ros2_controllers' diff_drive_controller)
MIN_VARIANCE = 1e-9  # variance of values without error: robot_localization's lower limit (ekf.cpp)
POSE_AXES, TWIST_AXES = (0, 1, 5), (0, 5)  # x, y and yaw; forward and turn rate


class WheelCovariance:
    """Covariances of n bases, computed from the travel of their wheels between readings.

    The travel between two readings counts as the travel of one tick.

    Attributes:
        pose: (n, 3, 3) of x, y in m and turn in rad, in the frame odom.
        twist: (n, 2, 2) of the speed ahead in m/s and the turn rate in rad/s.
    """

    def __init__(self, bases: int, wheel_base_m: float, spec: OdometrySpec) -> None:
        self.pose, self.twist = np.zeros((bases, 3, 3)), np.zeros((bases, 2, 2))
        self._by_slip, self._by_size = np.zeros((bases, 3, 3)), np.zeros((bases, 3, 2))
        self._spec, self._to_twist = spec, np.array([[0.5, 0.5], [-1.0 / wheel_base_m, 1.0 / wheel_base_m]])
        self._rounding_m2 = (spec.step_m**2 + spec.step**2) / 12.0  # variance of errors that are uniform over a step

    def add(self, course_rad: FloatArray, arc_m: FloatArray, travel_m: FloatArray, duration_s: float) -> None:
        """Add arcs (n,) driven on a mean course (n,), with this travel of the left and right wheel (n, 2)."""
        sin, cos = np.sin(course_rad), np.cos(course_rad)
        by_pose = np.tile(np.eye(3), (len(arc_m), 1, 1))  # F
        by_pose[:, 0, 2], by_pose[:, 1, 2] = -arc_m * sin, arc_m * cos
        by_arc = np.zeros((len(arc_m), 3, 2))  # derivative of the pose by arc and turn
        by_arc[:, 0, 0], by_arc[:, 0, 1] = cos, -0.5 * arc_m * sin
        by_arc[:, 1, 0], by_arc[:, 1, 1] = sin, 0.5 * arc_m * cos
        by_arc[:, 2, 1] = 1.0
        by_wheels = by_arc @ self._to_twist  # G
        slip_m2, spec = (self._spec.slip * travel_m) ** 2, self._spec
        self._by_slip = _transformed(by_pose, self._by_slip) + _transformed(by_wheels, _diagonal(slip_m2))
        self._by_size = by_pose @ self._by_size + by_wheels * travel_m[:, None, :]
        by_rounding = _transformed(by_wheels, self._rounding_m2 * np.eye(2))
        by_size = spec.wheel_error_std**2 * self._by_size @ self._by_size.swapaxes(1, 2)
        self.pose = self._by_slip + by_size + by_rounding
        if duration_s > 0.0:
            wheels_m2 = slip_m2 + (spec.wheel_error_std * travel_m) ** 2 + 2.0 * self._rounding_m2
            self.twist = _transformed(self._to_twist, _diagonal(wheels_m2)) / duration_s**2

    def pose_matrix(self, base: int) -> FloatArray:
        """Return the covariance (36,) of a PoseWithCovariance."""
        return _full(self.pose[base], POSE_AXES)

    def twist_matrix(self, base: int) -> FloatArray:
        """Return the covariance (36,) of a TwistWithCovariance; the speed to the left, 0, has the variance ahead."""
        full = _full(self.twist[base], TWIST_AXES)
        full[7] = full[0]
        return full


def variance_of(*errors_std: float, step: float = 0.0) -> float:
    """Return the variance of independent errors and of rounding to a step; never 0, which would mean unknown."""
    return max(sum(error**2 for error in errors_std) + step**2 / 12.0, MIN_VARIANCE)


def _diagonal(values: FloatArray) -> FloatArray:
    return values[:, :, None] * np.eye(values.shape[1])


def _transformed(matrix: FloatArray, covariance: FloatArray) -> FloatArray:
    return matrix @ covariance @ matrix.swapaxes(-1, -2)


def _full(covariance: FloatArray, axes: tuple[int, ...]) -> FloatArray:
    full = UNMEASURED * np.eye(6)
    full[np.ix_(axes, axes)] = covariance
    np.fill_diagonal(full, np.maximum(np.diag(full), MIN_VARIANCE))
    return full.ravel()
