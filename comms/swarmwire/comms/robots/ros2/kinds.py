"""Kinds of ROS 2 messages that drivers and gateways exchange."""

TWIST = "geometry_msgs/msg/Twist"  # what a base is to drive
TWIST_STAMPED = "geometry_msgs/msg/TwistStamped"  # the same with the time at which it was said
LASER_SCAN = "sensor_msgs/msg/LaserScan"  # distances around
ODOMETRY = "nav_msgs/msg/Odometry"  # where a base believes to be, by its wheels
IMU = "sensor_msgs/msg/Imu"  # acceleration, turn rate, orientation
BATTERY_STATE = "sensor_msgs/msg/BatteryState"  # voltage and charge
ILLUMINANCE = "sensor_msgs/msg/Illuminance"  # of a photocell, in lux
CLOCK = "rosgraph_msgs/msg/Clock"  # the time in an emulation


def dds_kind(kind: str) -> str:
    """The name of a kind of message in DDS, which rmw_zenoh writes into its keys.

    >>> dds_kind("geometry_msgs/msg/Twist")
    'geometry_msgs::msg::dds_::Twist_'
    """
    package, folder, name = kind.split("/")
    return f"{package}::{folder}::dds_::{name}_"
