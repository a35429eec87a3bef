"""Data sheets of the senses a body may have: what agents may know of their own sensors, and the world emulates.

A file per sense. A new one: its sheet in a file here, and its line in `SENSOR_SPECS`.
"""

from swarmwire.comms.bodies.ranging_specs import InfraredSpec, LightSpec, ProximitySpec, ScanSpec
from swarmwire.comms.bodies.sensor_specs import (
    BatterySpec,
    BumperSpec,
    CameraSpec,
    CompassSpec,
    GroundSpec,
    ImuSpec,
    OdometrySpec,
    PositioningSpec,
)
from swarmwire.comms.bodies.spec import SensorSpec

# By the name that a sheet and an agent's `needs` have for the sense.
SENSOR_SPECS: dict[str, type[SensorSpec]] = {
    "proximity": ProximitySpec,
    "compass": CompassSpec,
    "odometry": OdometrySpec,
    "light": LightSpec,
    "bumper": BumperSpec,
    "positioning": PositioningSpec,
    "infrared": InfraredSpec,
    "scan": ScanSpec,
    "ground": GroundSpec,
    "camera": CameraSpec,
    "imu": ImuSpec,
    "battery": BatterySpec,
}
