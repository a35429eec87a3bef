"""What the example takes of sensor_msgs.msg."""

from tests.support.comms.protocols.ros2.independent import LaserScan

__all__ = ["LaserScan"]
