"""The robots of `simulator.py` in ROS 2: poses by PyPI's zenoh-ros2-sdk, which needs no ROS 2 installation.

    python ros2_simulator.py [PORT] [SECONDS] [PERIOD_S]

The library gets the definitions of messages from the network when it runs first. A scenario of this folder listens with

    --set "robots.row.motion={source='ros2', type='geometry_msgs/msg/PoseStamped', listen=['tcp/127.0.0.1:7447']}"
"""

import sys
from typing import Any

from simulator import ROBOTS, gap_m, paced
from zenoh_ros2_sdk import ROS2Publisher, ZenohSession

POSE_STAMPED = "geometry_msgs/msg/PoseStamped"


def main(port: str = "7447", seconds: str = "300", period_s: str = "40") -> None:
    """Publish the poses until the time is over."""
    publishers = [ROS2Publisher(f"/row_{robot}/pose", POSE_STAMPED, router_port=int(port)) for robot in range(ROBOTS)]
    kinds: dict[str, Any] = ZenohSession.get_instance().store.types
    upright = kinds["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
    for time_s in paced(float(seconds)):
        stamp = kinds["builtin_interfaces/msg/Time"](int(time_s), round(time_s % 1 * 1e9))
        header = kinds["std_msgs/msg/Header"](stamp, "map")
        gap = gap_m(time_s, float(period_s))
        for robot, publisher in enumerate(publishers):
            at = kinds["geometry_msgs/msg/Point"]((robot - 0.5 * (ROBOTS - 1)) * gap, 0.0, 0.0)
            publisher.publish(header=header, pose=kinds["geometry_msgs/msg/Pose"](at, upright))


if __name__ == "__main__":
    main(*sys.argv[1:])
