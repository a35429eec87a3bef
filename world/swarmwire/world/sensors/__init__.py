"""Sensors: each has the truth (`sensor.Sensor`), from which `pipeline.Staged` makes readings.

A new sensor needs a spec in `swarmwire.comms.bodies`, a class here, and a line below.
"""

from collections.abc import Callable
from typing import Any

from swarmwire.comms.truth import Group
from swarmwire.world.sensors.camera import CameraSensor
from swarmwire.world.sensors.imu import ImuSensor
from swarmwire.world.sensors.light import LightSensor
from swarmwire.world.sensors.rays import InfraredSensor, ProximitySensor
from swarmwire.world.sensors.scan import ScanSensor
from swarmwire.world.sensors.sensor import Scene, Sensor
from swarmwire.world.sensors.simple import (
    BatterySensor,
    BumperSensor,
    CompassSensor,
    GroundSensor,
    OdometrySensor,
    PositioningSensor,
)

SENSORS: dict[str, Callable[[Scene, Group, Any], Sensor]] = {
    "proximity": ProximitySensor,
    "compass": CompassSensor,
    "odometry": OdometrySensor,
    "light": LightSensor,
    "bumper": BumperSensor,
    "positioning": PositioningSensor,
    "infrared": InfraredSensor,
    "scan": ScanSensor,
    "ground": GroundSensor,
    "camera": CameraSensor,
    "imu": ImuSensor,
    "battery": BatterySensor,
}

__all__ = ["SENSORS", "Scene"]
