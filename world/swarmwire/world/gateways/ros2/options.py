"""Options of the ROS 2 gateway."""

from dataclasses import dataclass

from swarmwire.comms.config import parameter
from swarmwire.comms.robots.ros2.messages import DISTROS
from swarmwire.comms.robots.ros2.other_sensors import FULL_LUX


@dataclass(frozen=True)
class Ros2GatewayOptions:
    """How the emulated bases answer, and when they stop by themselves."""

    domain: int = parameter(0, help="ROS_DOMAIN_ID of rmw_zenoh", at_least=0, at_most=232)
    distro: str = parameter("jazzy", help="distribution of ROS 2 whose nodes drive the robots", choices=DISTROS)
    stamped: bool = parameter(
        False, help="whether cmd_vel is announced as TwistStamped, not Twist; both are taken either way"
    )
    cmd_timeout_s: float = parameter(0.5, help="a base stops after so long without a command", unit="s", above=0)
    full_lux: float = parameter(
        FULL_LUX, help="illuminance that a photocell tells where it reads 1", unit="lx", above=0
    )
    north_deg: float = parameter(0.0, help="heading in the arena at which the IMU's yaw is 0", unit="deg")
