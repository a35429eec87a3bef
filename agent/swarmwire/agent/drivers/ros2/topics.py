"""The topics that the senses of a body come from."""

from math import radians

import numpy as np

from swarmwire.agent.drivers.ros2.options import Ros2Options
from swarmwire.agent.drivers.ros2.readers import (
    BatteryReader,
    ImuReader,
    LaserReader,
    LightReader,
    OdometryReader,
    Reader,
)
from swarmwire.comms.bodies.body import Body
from swarmwire.comms.bodies.drives import wheel_base_of
from swarmwire.comms.bodies.sensors import Battery
from swarmwire.comms.robots.ros2.other_sensors import topics_of_light


def readers_of(body: Body, options: Ros2Options) -> dict[str, Reader]:
    """A reader for each topic that tells of a sense of the body, by the topic's name within the namespace."""
    readers: dict[str, Reader] = {}
    if body.scan or body.proximity:
        readers[options.scan_topic] = LaserReader(body, radians(options.scanner_deg))
    if body.odometry and wheel_base_of(body.drive) > 0.0:
        readers[options.odometry_topic] = OdometryReader(wheel_base_of(body.drive), body.max_linear_mps)
    if "imu" in body.senses or body.compass:
        readers[options.imu_topic] = ImuReader(options.north_deg)
    battery = body.senses.get("battery")
    if isinstance(battery, Battery):
        readers[options.battery_topic] = BatteryReader(battery)
    if body.light:
        value = np.zeros((1, len(body.light.angle_rad)))
        for cell, topic in enumerate(topics_of_light(options.light_topic, value.shape[1])):
            readers[topic] = LightReader(value, cell, options.full_lux)
    return readers
