"""What the example takes of geometry_msgs.msg."""

from tests.comms.robots.ros2.independent import Twist

__all__ = ["Twist"]
