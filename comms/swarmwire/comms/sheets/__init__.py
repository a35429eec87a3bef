"""Data sheets of the senses a body may have: what agents may know of their own sensors, and the world emulates.

A file per sense. A new one: its sheet in a file here, and its line in `SHEETS`.
"""

from swarmwire.comms.sheets.battery import Battery
from swarmwire.comms.sheets.bumper import Bumper
from swarmwire.comms.sheets.camera import Camera
from swarmwire.comms.sheets.compass import Compass
from swarmwire.comms.sheets.ground import GroundColour
from swarmwire.comms.sheets.imu import Imu
from swarmwire.comms.sheets.infrared import Infrared
from swarmwire.comms.sheets.light import Light
from swarmwire.comms.sheets.odometry import Odometry
from swarmwire.comms.sheets.own import OwnSheet
from swarmwire.comms.sheets.positioning import Positioning
from swarmwire.comms.sheets.proximity import Proximity
from swarmwire.comms.sheets.rim import ResponseCurve, Rim
from swarmwire.comms.sheets.ring import Ring
from swarmwire.comms.sheets.scan import Scan
from swarmwire.comms.sheets.sheet import RangedSheet, Sheet

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
