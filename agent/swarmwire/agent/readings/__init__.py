"""What senses read in this tick: of one robot, and with a leading axis n, here written …, of n robots.

Where a robot has one number it is a float for an Agent, and (n,) for a VectorAgent.
"""

from swarmwire.agent.readings.around import InfraredReading, LightReading, ProximityReading
from swarmwire.agent.readings.battery import BatteryReading
from swarmwire.agent.readings.bumper import BumperReading, BumperReadings
from swarmwire.agent.readings.camera import Blob, CameraReading, CameraReadings
from swarmwire.agent.readings.compass import CompassReading
from swarmwire.agent.readings.ground import GroundReading
from swarmwire.agent.readings.imu import ImuReading
from swarmwire.agent.readings.odometry import OdometryReading
from swarmwire.agent.readings.own import OwnReading
from swarmwire.agent.readings.positioning import PositioningReading
from swarmwire.agent.readings.scan import ScanReading

__all__ = [
    "BatteryReading",
    "Blob",
    "BumperReading",
    "BumperReadings",
    "CameraReading",
    "CameraReadings",
    "CompassReading",
    "GroundReading",
    "ImuReading",
    "InfraredReading",
    "LightReading",
    "OdometryReading",
    "OwnReading",
    "PositioningReading",
    "ProximityReading",
    "ScanReading",
]
