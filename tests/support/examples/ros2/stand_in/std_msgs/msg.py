"""What the example takes of std_msgs.msg."""

from tests.support.comms.protocols.ros2.independent import UInt8MultiArray

__all__ = ["UInt8MultiArray"]
