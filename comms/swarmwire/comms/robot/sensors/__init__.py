"""Sensors: their keys in body files, the fields and types of their readings, and the properties that read them.

To add a sensor, declare it in a file of this package (`imu.py` is a short example): its spec, with the fields of a
reading and the name of its truth, and its reading. Add a property to `Sensors` and one to `Body`. The truth is a class
in `swarmwire.world.sensors`.
"""

from abc import abstractmethod
from typing import Any, Generic

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.robot.sensors.camera import CameraReading, CameraReadings, CameraSpec
from swarmwire.comms.robot.sensors.imu import ImuReading, ImuSpec
from swarmwire.comms.robot.sensors.light import LightReading, LightSpec
from swarmwire.comms.robot.sensors.rays import InfraredReading, InfraredSpec, ProximityReading, ProximitySpec
from swarmwire.comms.robot.sensors.scan import ScanReading, ScanSpec
from swarmwire.comms.robot.sensors.sensor import N, SensorProperty, SensorSpec
from swarmwire.comms.robot.sensors.simple import (
    BatteryReading,
    BatterySpec,
    BumperReading,
    BumperReadings,
    BumperSpec,
    CompassReading,
    CompassSpec,
    FlowReading,
    FlowSpec,
    GroundReading,
    GroundSpec,
    OdometryReading,
    OdometrySpec,
    PositioningReading,
    PositioningSpec,
)


class Sensors(Generic[N]):
    """The built-in sensors, under their names in body files and in the `needs` of agents.

    Base class of the handles of one robot (N is float) and of n robots (N is FloatArray).
    """

    __slots__ = ()  # setting an unknown attribute of a handle raises

    proximity = SensorProperty(ProximitySpec, ProximityReading[float], ProximityReading[FloatArray])
    compass = SensorProperty(CompassSpec, CompassReading[float], CompassReading[FloatArray])
    odometry = SensorProperty(OdometrySpec, OdometryReading[float], OdometryReading[FloatArray])
    light = SensorProperty(LightSpec, LightReading[float], LightReading[FloatArray])
    bumper = SensorProperty(BumperSpec, BumperReading.from_columns, BumperReadings)
    positioning = SensorProperty(PositioningSpec, PositioningReading[float], PositioningReading[FloatArray])
    infrared = SensorProperty(InfraredSpec, InfraredReading[float], InfraredReading[FloatArray])
    scan = SensorProperty(ScanSpec, ScanReading, ScanReading)
    ground = SensorProperty(GroundSpec, GroundReading, GroundReading)
    camera = SensorProperty(CameraSpec, CameraReading.from_columns, CameraReadings)
    imu = SensorProperty(ImuSpec, ImuReading[float], ImuReading[FloatArray])
    battery = SensorProperty(BatterySpec, BatteryReading[float], BatteryReading[FloatArray])
    flow = SensorProperty(FlowSpec, FlowReading[float], FlowReading[FloatArray])

    @abstractmethod
    def _reading(self, sensor: SensorProperty[Any, Any]) -> Any:
        """Return the reading of a sensor in this tick."""


SENSOR_SPECS: dict[str, type[SensorSpec]] = {
    name: sensor.spec for name, sensor in vars(Sensors).items() if isinstance(sensor, SensorProperty)
}
