"""What the example takes of geometry_msgs.msg."""

from tests.support.comms.protocols.ros2.independent import Twist

__all__ = ["Twist"]
