"""A ROS 2 node that drives a robot ahead, and turns it where something is near.

Written as for a real base: it subscribes `scan`, publishes `cmd_vel`, and knows nothing of emulation. docs/ros2.md says
how to run it. With ROS 2 sourced, for the robot in the namespace /wanderers_0:

    python3 drive_and_turn.py --ros-args -r __ns:=/wanderers_0

On a TurtleBot 4, whose scanner is mounted a quarter turn to the left, with `-p scanner_deg:=90.0`.
"""

import math

import rclpy
from geometry_msgs.msg import Twist
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import LaserScan

SPEED_MPS, TURN_RADPS = 0.15, 1.2
NEAR_M = 0.45  # a return ahead that is nearer than this is in the way
AHEAD_RAD = math.radians(40.0)  # half width of what counts as ahead
PERIOD_S = 0.1  # bases stop by themselves without a command for half a second


class DriveAndTurn(Node):
    def __init__(self) -> None:
        super().__init__("drive_and_turn")
        self.command: Twist | None = None
        self.turns_left = True
        self.scanner_rad = math.radians(self.declare_parameter("scanner_deg", 0.0).value)  # where its angle 0 looks
        self.commands = self.create_publisher(Twist, "cmd_vel", 10)
        self.create_subscription(LaserScan, "scan", self.on_scan, qos_profile_sensor_data)
        self.create_timer(PERIOD_S, self.on_timer)

    def on_scan(self, scan: LaserScan) -> None:
        """Decide by the returns ahead; turn to the side with more room, and keep to it until the way is free."""
        left_m = right_m = math.inf
        for ray, range_m in enumerate(scan.ranges):
            angle_rad = math.remainder(self.scanner_rad + scan.angle_min + ray * scan.angle_increment, 2.0 * math.pi)
            if abs(angle_rad) <= AHEAD_RAD and scan.range_min <= range_m <= scan.range_max:
                left_m = min(left_m, range_m) if angle_rad > 0.0 else left_m
                right_m = min(right_m, range_m) if angle_rad <= 0.0 else right_m
        command = Twist()
        if min(left_m, right_m) < NEAR_M:
            if self.command is None or self.command.angular.z == 0.0:
                self.turns_left = left_m > right_m
            command.angular.z = TURN_RADPS if self.turns_left else -TURN_RADPS
        else:
            command.linear.x = SPEED_MPS
        self.command = command

    def on_timer(self) -> None:
        """Say it again, whether or not there was a scan since."""
        if self.command is not None:
            self.commands.publish(self.command)


def main() -> None:
    rclpy.init()
    node = DriveAndTurn()
    try:
        rclpy.spin(node)
    except KeyboardInterrupt:
        pass
    finally:
        node.commands.publish(Twist())  # at rest
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
