"""The registry of the built-in sensors' specs.

Agents get the specs of their own sensors; the world emulates the sensors by them. A new sensor needs a spec class in
`sensor_specs` or `ranging_specs` and a line in `SENSOR_SPECS`.
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

# By the name of the sensor in body files and in the `needs` of agents.
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
