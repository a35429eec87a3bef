"""What the example takes of sensor_msgs.msg."""

from tests.comms.robots.ros2.independent import LaserScan

__all__ = ["LaserScan"]
