"""What the example takes of rclpy, over zenoh as rmw_zenoh or a bridge lays it out.

ROS_STAND_IN is "rmw" or "bridge" and the endpoint to reach, with a space between.
"""

import os
import sys

from rclpy.node import Node, Wire


def init() -> None:
    """Connect; what stands behind `--ros-args`, such as `-r __ns:=/flock_0` or `-p scanner_deg:=90.0`, is taken."""
    Node.parameters = dict(text.split(":=") for text in sys.argv if ":=" in text)
    transport, endpoint = os.environ["ROS_STAND_IN"].split()
    Wire.opened = Wire(transport, endpoint, Node.parameters.get("__ns", "/"))


def spin(node: Node) -> None:
    """Do what comes in, one thing after the other, until somebody asks for the end."""
    node.spin()


def try_shutdown() -> None:
    """Hang up."""
    if Wire.opened is not None:
        Wire.opened.close()
        Wire.opened = None
