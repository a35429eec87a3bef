"""Where bases believe to be, from what their wheels have rolled: the pose in the Odometry messages that they send."""

from typing import Any

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.clock import to_s
from swarmwire.comms.robots.ros2.kinds import ODOMETRY
from swarmwire.comms.robots.ros2.messages import Messages
from swarmwire.comms.robots.ros2.yaw import quaternion, within_turn

FRAME, CHILD_FRAME = "odom", "base_footprint"


class WheelPoses:
    """The poses of n bases, each of which drives an arc between two readings, and up to the first one from the origin.

    Attributes:
        pose: (n, 3) x and y in m, turn since the start in rad, which is not wrapped.
        speed: (n, 2) in m/s and rad/s, between the last two readings.
    """

    def __init__(self, bases: int, wheel_base_m: float) -> None:
        self.pose, self.speed = np.zeros((bases, 3)), np.zeros((bases, 2))
        self._wheel_base_m = wheel_base_m
        self._before_ns, self._before_m = 0, np.zeros((2, bases))

    def follow(self, time_ns: int, left_m: FloatArray, right_m: FloatArray) -> None:
        """Add the travel (n,) of both wheels since the last reading; where it is nan, as soon as it is told again."""
        travel_m = np.stack([left_m, right_m])
        travel_m = np.where(np.isnan(travel_m), self._before_m, travel_m)
        by_m, for_ns = travel_m - self._before_m, time_ns - self._before_ns
        self._before_ns, self._before_m = time_ns, travel_m
        arc_m, turn_rad = 0.5 * (by_m[0] + by_m[1]), (by_m[1] - by_m[0]) / self._wheel_base_m
        chord_m = arc_m * np.sinc(turn_rad / (2.0 * np.pi))
        course_rad = self.pose[:, 2] + 0.5 * turn_rad
        self.pose += np.stack([chord_m * np.cos(course_rad), chord_m * np.sin(course_rad), turn_rad], axis=1)
        if for_ns > 0:
            self.speed = np.stack([arc_m, turn_rad], axis=1) / to_s(for_ns)

    def message(self, messages: Messages, base: int, stamp_ns: int) -> Any:
        """The Odometry message of one base; covariances are 0: not known."""
        x_m, y_m, turn_rad = map(float, self.pose[base])
        linear_mps, angular_radps = map(float, self.speed[base])
        make, unknown = messages.make, np.zeros(36)
        place = make("geometry_msgs/msg/Point", x_m, y_m, 0.0)
        pose = make("geometry_msgs/msg/Pose", place, quaternion(messages, within_turn(turn_rad)))
        linear = make("geometry_msgs/msg/Vector3", linear_mps, 0.0, 0.0)
        angular = make("geometry_msgs/msg/Vector3", 0.0, 0.0, angular_radps)
        twist = make("geometry_msgs/msg/Twist", linear, angular)
        return make(
            ODOMETRY,
            messages.header(stamp_ns, FRAME),
            CHILD_FRAME,
            make("geometry_msgs/msg/PoseWithCovariance", pose, unknown),
            make("geometry_msgs/msg/TwistWithCovariance", twist, unknown),
        )
