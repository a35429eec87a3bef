"""What a robot's senses read in this tick, a file per sense. Arrays have a leading axis n for a VectorAgent."""

from swarmwire.agent.readings.battery import BatteryReading, BatteryReadings
from swarmwire.agent.readings.bumper import BumperReading, BumperReadings
from swarmwire.agent.readings.camera import Blob, CameraReading, CameraReadings
from swarmwire.agent.readings.compass import CompassReading, CompassReadings
from swarmwire.agent.readings.ground import GroundReading, GroundReadings
from swarmwire.agent.readings.imu import ImuReading, ImuReadings
from swarmwire.agent.readings.infrared import InfraredReading, InfraredReadings
from swarmwire.agent.readings.light import LightReading, LightReadings
from swarmwire.agent.readings.odometry import OdometryReading, OdometryReadings
from swarmwire.agent.readings.own import OwnReading
from swarmwire.agent.readings.positioning import PositioningReading, PositioningReadings
from swarmwire.agent.readings.proximity import ProximityReading, ProximityReadings
from swarmwire.agent.readings.scan import ScanReading, ScanReadings

__all__ = [
    "BatteryReading",
    "BatteryReadings",
    "Blob",
    "BumperReading",
    "BumperReadings",
    "CameraReading",
    "CameraReadings",
    "CompassReading",
    "CompassReadings",
    "GroundReading",
    "GroundReadings",
    "ImuReading",
    "ImuReadings",
    "InfraredReading",
    "InfraredReadings",
    "LightReading",
    "LightReadings",
    "OdometryReading",
    "OdometryReadings",
    "OwnReading",
    "PositioningReading",
    "PositioningReadings",
    "ProximityReading",
    "ProximityReadings",
    "ScanReading",
    "ScanReadings",
]
