"""What the example takes of rclpy.qos."""

qos_profile_sensor_data = "sensor data"
