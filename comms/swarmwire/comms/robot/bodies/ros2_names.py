"""The names of a robot in ROS 2: the table `ros2` of a body file."""

from dataclasses import dataclass

from swarmwire.comms.base.config import parameter


@dataclass(frozen=True)
class Ros2Names:
    """Names of joints and frames, the direction of the scanner's frame, and whether the base is a Create 3."""

    left_joint: str = parameter("wheel_left_joint", help="joint of the left wheel in `joint_states`")
    right_joint: str = parameter("wheel_right_joint", help="joint of the right wheel")
    scan_frame: str = parameter("base_scan", help="frame of the scanner")
    scan_frame_deg: float = parameter(
        0.0, help="direction of that frame's x axis, counter-clockwise from ahead", unit="deg"
    )
    create3: bool = parameter(False, help="true: the base is iRobot's Create 3, with its topics")


DEFAULT_NAMES = Ros2Names()  # names of a TurtleBot3
