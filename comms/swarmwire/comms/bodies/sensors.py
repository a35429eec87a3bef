"""Data sheets of the senses a body may have: what agents may know of their own sensors, and the world emulates.

A file per sense. A new one: its sheet in a file here, and its line in `SHEETS`.
"""

from swarmwire.comms.bodies.custom import OwnSheet
from swarmwire.comms.bodies.ranging_specs import Infrared, Light, Proximity, ResponseCurve, Rim, Ring, Scan
from swarmwire.comms.bodies.sensor_specs import (
    Battery,
    Bumper,
    Camera,
    Compass,
    GroundColour,
    Imu,
    Odometry,
    Positioning,
)
from swarmwire.comms.bodies.spec import RangedSheet, Sheet

# By the name that a sheet and an agent's `needs` have for the sense.
SHEETS: dict[str, type[Sheet]] = {
    "proximity": Proximity,
    "compass": Compass,
    "odometry": Odometry,
    "light": Light,
    "bumper": Bumper,
    "positioning": Positioning,
    "infrared": Infrared,
    "scan": Scan,
    "ground": GroundColour,
    "camera": Camera,
    "imu": Imu,
    "battery": Battery,
}

__all__ = [
    "SHEETS",
    "Battery",
    "Bumper",
    "Camera",
    "Compass",
    "GroundColour",
    "Imu",
    "Infrared",
    "Light",
    "Odometry",
    "OwnSheet",
    "Positioning",
    "Proximity",
    "RangedSheet",
    "ResponseCurve",
    "Rim",
    "Ring",
    "Scan",
    "Sheet",
]
