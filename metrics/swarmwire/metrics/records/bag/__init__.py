"""Runs as MCAP files in the form of ROS 2's bags, for Foxglove, rviz and `ros2 bag`."""
