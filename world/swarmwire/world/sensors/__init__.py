"""What robots sense, a file per sensor: the truth (`sensor.TrueSense`), of which `staged.Staged` makes readings.

A new one: a sheet in `swarmwire.comms.bodies.sensors`, a file here, a line below.
"""

from collections.abc import Callable
from typing import Any

from swarmwire.comms.truth import Group
from swarmwire.world.sensors.battery import BatterySensor
from swarmwire.world.sensors.bumper import BumperSensor
from swarmwire.world.sensors.camera import CameraSensor
from swarmwire.world.sensors.compass import CompassSensor
from swarmwire.world.sensors.ground import GroundSensor
from swarmwire.world.sensors.imu import ImuSensor
from swarmwire.world.sensors.infrared import InfraredSensor
from swarmwire.world.sensors.light import LightSensor
from swarmwire.world.sensors.odometry import OdometrySensor
from swarmwire.world.sensors.positioning import PositioningSensor
from swarmwire.world.sensors.proximity import ProximitySensor
from swarmwire.world.sensors.scan import ScanSensor
from swarmwire.world.sensors.scene import Scene
from swarmwire.world.sensors.sensor import TrueSense

SENSORS: dict[str, Callable[[Scene, Group, Any], TrueSense]] = {
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
