"""What a message of each topic means to an agent: the fields of the senses that it gives."""

from abc import ABC, abstractmethod
from typing import Any, ClassVar

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.bodies.body import Body
from swarmwire.comms.bodies.sensors import Battery
from swarmwire.comms.robots.ros2.keys import BATTERY_STATE, ILLUMINANCE, IMU, LASER_SCAN, ODOMETRY
from swarmwire.comms.robots.ros2.laser import LaserAsProximity, LaserAsScan
from swarmwire.comms.robots.ros2.motion import WheelTravel, motion_of
from swarmwire.comms.robots.ros2.other_sensors import brightness_of, charge_of

Fields = dict[str, FloatArray]  # "sense.field" -> (1,) or (1, width)


class Reader(ABC):
    """One topic.

    Attributes:
        kind: of its messages.
        keeps: how many messages count that came since the last look.
        is_steady: whether silence on it means that the base is lost.
        fields: the newest readings; what a lost one reads, until a message came.
    """

    kind: ClassVar[str]
    keeps: ClassVar[int] = 1
    is_steady: ClassVar[bool] = True
    fields: Fields

    @abstractmethod
    def read(self, message: Any) -> None:
        """Take over what a message says; BadFrame, and nothing is changed, if it cannot be."""

    def counts(self) -> dict[str, int]:
        """Oddities so far, by name."""
        return {}


class LaserReader(Reader):
    """LaserScan: `scan` and `proximity`, whichever the body has."""

    kind = LASER_SCAN

    def __init__(self, body: Body, scanner_rad: float) -> None:
        at_m = body.scan.at_m if body.scan else 0.0
        self._scan = LaserAsScan(body.scan, scanner_rad) if body.scan else None
        near = body.proximity
        self._proximity = LaserAsProximity(near, body.radius_m, at_m, scanner_rad) if near else None
        self.fields = {}
        if body.scan:
            self.fields["scan.range_m"] = np.full((1, body.scan.rays), np.inf)
        if near:
            self.fields["proximity.value"] = np.zeros((1, len(near.angle_rad)))

    def read(self, message: Any) -> None:
        """As `Reader.read`."""
        fields: Fields = {}
        if self._scan:
            fields["scan.range_m"] = self._scan.range_m(message)[np.newaxis]
        if self._proximity:
            fields["proximity.value"] = self._proximity.value(message)[np.newaxis]
        self.fields = fields


class OdometryReader(Reader):
    """Odometry: `odometry`, the travel of both wheels since the driver was made."""

    kind = ODOMETRY
    keeps = 64

    def __init__(self, wheel_base_m: float, max_linear_mps: float) -> None:
        self._travel = WheelTravel(wheel_base_m, max_linear_mps)
        self.fields = _numbers("odometry", left_m=np.nan, right_m=np.nan)

    def read(self, message: Any) -> None:
        """As `Reader.read`."""
        self._travel.follow(message)
        self.fields = _numbers("odometry", left_m=self._travel.left_m, right_m=self._travel.right_m)

    def counts(self) -> dict[str, int]:
        """As `Reader.counts`."""
        return {"odometry_jumps": self._travel.jumps}


class ImuReader(Reader):
    """Imu: `imu` and `compass`."""

    kind = IMU

    def __init__(self, north_deg: float) -> None:
        self._north_deg = north_deg
        self.fields = _motion(np.nan, np.nan, np.nan, np.nan)

    def read(self, message: Any) -> None:
        """As `Reader.read`."""
        self.fields = _motion(*motion_of(message, self._north_deg))


class BatteryReader(Reader):
    """BatteryState: `battery`."""

    kind = BATTERY_STATE
    is_steady = False

    def __init__(self, sheet: Battery) -> None:
        self._sheet = sheet
        self.fields = _numbers("battery", charge=np.nan, voltage_v=np.nan)

    def read(self, message: Any) -> None:
        """As `Reader.read`."""
        self.fields = _numbers("battery", charge=charge_of(message, self._sheet), voltage_v=message.voltage)


class LightReader(Reader):
    """Illuminance: one cell of `light`; all cells share the field."""

    kind = ILLUMINANCE
    is_steady = False

    def __init__(self, value: FloatArray, cell: int, full_lux: float) -> None:
        """`value` (1, cells) is shared."""
        self._cell, self._full_lux = cell, full_lux
        self.fields = {"light.value": value}

    def read(self, message: Any) -> None:
        """As `Reader.read`."""
        self.fields["light.value"][0, self._cell] = brightness_of(message, self._full_lux)


def _motion(forward_mps2: float, left_mps2: float, turn_radps: float, heading_rad: float) -> Fields:
    imu = _numbers("imu", forward_mps2=forward_mps2, left_mps2=left_mps2, turn_radps=turn_radps)
    return {**imu, **_numbers("compass", heading_rad=heading_rad)}


def _numbers(sense: str, **values: float) -> Fields:
    return {f"{sense}.{name}": np.array([value], np.float64) for name, value in values.items()}
