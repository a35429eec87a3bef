"""Options of the ROS 2 driver."""

from dataclasses import dataclass

from swarmwire.comms.config import parameter
from swarmwire.comms.robots.ros2.keys import check_name
from swarmwire.comms.robots.ros2.messages import DISTROS
from swarmwire.comms.robots.ros2.other_sensors import FULL_LUX

TRANSPORTS = ("bridge", "rmw")
NO_NAMESPACE = "/"


@dataclass(frozen=True)
class Ros2Options:
    """How the base is reached, what its topics are called, and what its readings mean."""

    transport: str = parameter(
        "bridge",
        help="what the base speaks zenoh by: zenoh-bridge-ros2dds, or rmw_zenoh",
        choices=TRANSPORTS,
    )
    namespace: str = parameter("", help="where its topics lie; empty: the robot's name as ROS takes it; /: nowhere")
    domain: int = parameter(0, help="ROS_DOMAIN_ID of rmw_zenoh", at_least=0, at_most=232)
    distro: str = parameter("jazzy", help="distribution of ROS 2 on the base", choices=DISTROS)
    stamped: bool = parameter(False, help="whether the base takes TwistStamped, not Twist")
    command_topic: str = parameter("cmd_vel", help="topic of commands")
    scan_topic: str = parameter("scan", help="topic of LaserScan")
    odometry_topic: str = parameter("odom", help="topic of Odometry")
    imu_topic: str = parameter("imu", help="topic of Imu")
    battery_topic: str = parameter("battery_state", help="topic of BatteryState")
    light_topic: str = parameter("illuminance", help="topic of Illuminance; of several photocells with _0, _1, …")
    full_lux: float = parameter(FULL_LUX, help="illuminance at which a photocell reads 1", unit="lx", above=0)
    north_deg: float = parameter(0.0, help="heading in the arena at which the IMU's yaw is 0", unit="deg")
    scanner_deg: float = parameter(
        0.0, help="where the scanner's angle 0 looks, counter-clockwise from ahead", unit="deg"
    )
    stale_s: float = parameter(
        1.0, help="a base whose scanner, odometry or IMU is silent so long is lost", unit="s", above=0
    )
    connect_s: float = parameter(
        3.0, help="how long a connection, a base behind it and its first message are waited for", unit="s", above=0
    )

    def check(self) -> None:
        """Raise BadInput with the key of a name that ROS 2 does not have."""
        if self.namespace not in ("", NO_NAMESPACE):
            check_name(self.namespace, "driver", "namespace")
        for key in ("command", "scan", "odometry", "imu", "battery", "light"):
            check_name(getattr(self, f"{key}_topic"), "driver", f"{key}_topic")
