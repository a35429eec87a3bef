"""What the two wheels of a base have rolled, from the poses that it tells in Odometry messages.

Between two of them the base is taken to drive an arc: of chord c and turn a it is c (a / 2) / sin(a / 2) long, forwards
or backwards as the chord lies to the heading half way. The wheels roll that length -+ a times half the wheel base.
"""

from math import cos, hypot, isfinite, sin
from typing import Any

from swarmwire.comms.clock import to_s
from swarmwire.comms.errors import BadFrame
from swarmwire.comms.robots.ros2.messages import stamp_ns
from swarmwire.comms.robots.ros2.yaw import within_turn, yaw_of

SPARE_M, SPARE = 0.1, 2.0  # a base may be measured that much further on, and that many times as fast as it can drive
STRAIGHT_RAD = 1e-6  # below this an arc is as long as its chord

Pose = tuple[float, float, float]


class WheelTravel:
    """Adds up the travel of both wheels since the first message.

    Attributes:
        left_m: travelled by the left wheel.
        right_m: travelled by the right wheel.
        jumps: how often the pose went further than the base can drive: it began anew there.
    """

    def __init__(self, wheel_base_m: float, max_linear_mps: float) -> None:
        self.left_m = self.right_m = 0.0
        self.jumps = 0
        self._half_base_m, self._max_mps = 0.5 * wheel_base_m, max_linear_mps
        self._last: tuple[int, Pose] | None = None

    def follow(self, message: Any) -> None:
        """Add what an Odometry message says, later than the last one; BadFrame if its pose is none."""
        pose, at = message.pose.pose, stamp_ns(message.header)
        x_m, y_m, yaw_rad = pose.position.x, pose.position.y, yaw_of(pose.orientation)
        if not (isfinite(x_m) and isfinite(y_m) and isfinite(yaw_rad)):
            raise BadFrame("malformed", "a pose that is not finite")
        if self._last is not None:
            before_ns, before = self._last
            self._add((x_m - before[0], y_m - before[1], yaw_rad - before[2]), before[2], to_s(at - before_ns))
        self._last = at, (x_m, y_m, yaw_rad)

    def _add(self, by: Pose, yaw_rad: float, for_s: float) -> None:
        chord_m, turn_rad = hypot(by[0], by[1]), within_turn(by[2])
        if chord_m > SPARE * self._max_mps * max(for_s, 0.0) + SPARE_M:
            self.jumps += 1
            return
        half_rad = 0.5 * turn_rad
        ahead = by[0] * cos(yaw_rad + half_rad) + by[1] * sin(yaw_rad + half_rad)
        arc_m = chord_m * (half_rad / sin(half_rad) if abs(half_rad) > STRAIGHT_RAD else 1.0)
        arc_m = arc_m if ahead >= 0.0 else -arc_m
        self.left_m += arc_m - turn_rad * self._half_base_m
        self.right_m += arc_m + turn_rad * self._half_base_m
