"""Data sheets of the senses a body may have: what agents may know of their own sensors, and the world emulates.

A file per sense. A new one: its sheet in a file here, and its line in `SENSOR_SPECS`.
"""

from swarmwire.comms.bodies.ranging_specs import Infrared, Light, Proximity, Scan
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
from swarmwire.comms.bodies.spec import SensorSpec

# By the name that a sheet and an agent's `needs` have for the sense.
SENSOR_SPECS: dict[str, type[SensorSpec]] = {
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
