"""The driver of a ROS 2 base, reached through zenoh."""

from swarmwire.agent.drivers.ros2.driver import Ros2Driver
from swarmwire.agent.drivers.ros2.topics import Ros2Options

__all__ = ["Ros2Driver", "Ros2Options"]
