"""ROS 2 over zenoh: keys, tokens and messages as zenoh-bridge-ros2dds and rmw_zenoh lay them out."""
