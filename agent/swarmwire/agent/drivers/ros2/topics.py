"""Topics of the ROS 2 driver: its options, and a reader per topic that turns messages into fields of sensors."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from math import radians
from typing import Any, ClassVar

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.config import parameter
from swarmwire.comms.protocols.ros2.keys import BATTERY_STATE, ILLUMINANCE, IMU, LASER_SCAN, ODOMETRY, check_name
from swarmwire.comms.protocols.ros2.laser import LaserAsProximity, LaserAsScan
from swarmwire.comms.protocols.ros2.messages import DISTROS, HAZARDS, INTENSITIES
from swarmwire.comms.protocols.ros2.motion import WheelTravel, motion_of, motion_sensors
from swarmwire.comms.protocols.ros2.readings import (
    FULL_LUX,
    brightness_of,
    charge_of,
    is_pressed,
    shades_of,
    topics_of_light,
)
from swarmwire.comms.robot.bodies.body import Body
from swarmwire.comms.robot.bodies.drives import wheel_base_of
from swarmwire.comms.robot.sensors.simple import BatterySpec, GroundSpec

TRANSPORTS = ("bridge", "rmw")
NO_NAMESPACE = "/"
Fields = dict[str, FloatArray]  # "sensor.field" -> (1,) or (1, width)


@dataclass(frozen=True)
class Ros2Options:
    """Connection to the base, names of its topics, and the meaning of its readings."""

    transport: str = parameter(
        "bridge",
        help="the base's Zenoh connection: zenoh-bridge-ros2dds or rmw_zenoh",
        choices=TRANSPORTS,
    )
    namespace: str = parameter("", help="namespace of the topics; empty: the robot's name as a ROS name; /: none")
    domain: int = parameter(0, help="ROS_DOMAIN_ID of rmw_zenoh", at_least=0, at_most=232)
    distro: str = parameter("jazzy", help="distribution of ROS 2 on the base", choices=DISTROS)
    stamped: bool = parameter(False, help="send TwistStamped instead of Twist")
    command_topic: str = parameter("cmd_vel", help="topic of commands")
    scan_topic: str = parameter("scan", help="topic of LaserScan")
    odometry_topic: str = parameter("odom", help="topic of Odometry")
    imu_topic: str = parameter("imu", help="topic of Imu")
    battery_topic: str = parameter("battery_state", help="topic of BatteryState")
    hazard_topic: str = parameter("hazard_detection", help="topic of a Create 3's hazards")
    cliff_topic: str = parameter("cliff_intensity", help="topic of a Create 3's cliff sensors")
    light_topic: str = parameter("illuminance", help="topic of Illuminance; several photocells add _0, _1, …")
    full_lux: float = parameter(FULL_LUX, help="illuminance at which a photocell reads 1", unit="lx", above=0)
    north_deg: float = parameter(0.0, help="heading in the arena at which the IMU's yaw is 0", unit="deg")
    scanner_deg: float = parameter(
        0.0, help="angle of the scanner from its direction in the body's sheet, counter-clockwise", unit="deg"
    )
    stale_s: float = parameter(
        1.0, help="silence of scanner, odometry, IMU or hazards after which the base is lost", unit="s", above=0
    )
    connect_s: float = parameter(
        3.0, help="timeout of the connection, of the base behind it, and of its first message", unit="s", above=0
    )

    def check(self) -> None:
        """BadInput with the key of a name that ROS 2 does not allow."""
        if self.namespace not in ("", NO_NAMESPACE):
            check_name(self.namespace, "driver", "namespace")
        for key in ("command", "scan", "odometry", "imu", "battery", "hazard", "cliff", "light"):
            check_name(getattr(self, f"{key}_topic"), "driver", f"{key}_topic")


class Reader(ABC):
    """The reader of one topic.

    Attributes:
        kind: type of its messages.
        keeps: number of messages that are buffered between two reads.
        is_steady: True if silence means that the base is lost.
        fields: the newest readings; blank ones until the first message.
    """

    kind: ClassVar[str]
    keeps: int = 1
    is_steady: ClassVar[bool] = True
    fields: Fields

    @abstractmethod
    def read(self, message: Any) -> None:
        """Store the readings of a message; BadFrame, without a change, if it is invalid."""

    def counts(self) -> dict[str, int]:
        """Return the numbers of faults so far, by name."""
        return {}


class LaserReader(Reader):
    """LaserScan as `scan` and `proximity`, if the body has them."""

    kind = LASER_SCAN

    def __init__(self, body: Body, scanner_rad: float) -> None:
        scanner_m = body.scan.at_m if body.scan else 0.0
        self._scan = LaserAsScan(body.scan, scanner_rad) if body.scan else None
        proximity = body.proximity
        self._proximity = LaserAsProximity(proximity, body.radius_m, scanner_m, scanner_rad) if proximity else None
        self.fields = {}
        if body.scan:
            self.fields |= body.scan.blank("scan", 1)
        if proximity:
            self.fields |= proximity.blank("proximity", 1)

    def read(self, message: Any) -> None:
        """Convert the scan to the sensors' rays."""
        fields: Fields = {}
        if self._scan:
            fields["scan.range_m"] = self._scan.range_m(message)[np.newaxis]
        if self._proximity:
            fields["proximity.value"] = self._proximity.value(message)[np.newaxis]
        self.fields = fields


class OdometryReader(Reader):
    """Odometry as `odometry`: the travel of both wheels since the start of the driver."""

    kind = ODOMETRY
    keeps = 64

    def __init__(self, wheel_base_m: float, max_linear_mps: float) -> None:
        self._travel = WheelTravel(wheel_base_m, max_linear_mps)
        self.fields = _numbers("odometry", left_m=np.nan, right_m=np.nan)

    def read(self, message: Any) -> None:
        """Add the motion since the previous message."""
        self._travel.add(message)
        self.fields = _numbers("odometry", left_m=self._travel.left_m, right_m=self._travel.right_m)

    def counts(self) -> dict[str, int]:
        """Return the number of jumps of the base's odometry."""
        return {"odometry_jumps": self._travel.jumps}


class ImuReader(Reader):
    """Imu as `imu` and `compass`."""

    kind = IMU

    def __init__(self, north_deg: float, *, is_apart: bool = False) -> None:
        """Expect separate messages of accelerations and heading if `is_apart`."""
        self._north_deg, self._is_apart = north_deg, is_apart
        self.keeps = 2 if is_apart else 1
        self.fields = _motion(np.nan, np.nan, np.nan, np.nan)

    def read(self, message: Any) -> None:
        """Store accelerations, turn rate and heading; with `is_apart`, those that the message has."""
        fields = _motion(*motion_of(message, self._north_deg))
        if self._is_apart:
            fields = {name: self.fields[name] if np.isnan(value[0]) else value for name, value in fields.items()}
        self.fields = fields


class BatteryReader(Reader):
    """BatteryState as `battery`."""

    kind = BATTERY_STATE
    is_steady = False

    def __init__(self, spec: BatterySpec) -> None:
        self._spec = spec
        self.fields = spec.blank("battery", 1)

    def read(self, message: Any) -> None:
        """Store charge and voltage."""
        self.fields = _numbers("battery", charge=charge_of(message, self._spec), voltage_v=message.voltage)


class HazardReader(Reader):
    """HazardDetectionVector as `bumper`."""

    kind = HAZARDS

    def __init__(self) -> None:
        self.fields = _numbers("bumper", pressed=0.0)

    def read(self, message: Any) -> None:
        """Store the bumper's state."""
        self.fields = _numbers("bumper", pressed=float(is_pressed(message)))


class CliffReader(Reader):
    """IrIntensityVector of the cliff sensors as `ground`."""

    kind = INTENSITIES
    is_steady = False

    def __init__(self, spec: GroundSpec) -> None:
        self.fields = spec.blank("ground", 1)

    def read(self, message: Any) -> None:
        """Store the shade below each cliff sensor."""
        self.fields = {"ground.shade": shades_of(message)[np.newaxis]}


class LightReader(Reader):
    """Illuminance as one cell of `light`; all cells share the field."""

    kind = ILLUMINANCE
    is_steady = False

    def __init__(self, value: FloatArray, cell: int, full_lux: float) -> None:
        """Write the readings to `value` (1, cells), which all cells share."""
        self._cell, self._full_lux = cell, full_lux
        self.fields = {"light.value": value}

    def read(self, message: Any) -> None:
        """Store the brightness of the cell."""
        self.fields["light.value"][0, self._cell] = brightness_of(message, self._full_lux)


def _motion(forward_mps2: float, left_mps2: float, turn_radps: float, heading_rad: float) -> Fields:
    imu = _numbers("imu", forward_mps2=forward_mps2, left_mps2=left_mps2, turn_radps=turn_radps)
    return {**imu, **_numbers("compass", heading_rad=heading_rad)}


def _numbers(sensor: str, **values: float) -> Fields:
    return {f"{sensor}.{name}": np.array([value], np.float64) for name, value in values.items()}


def readers_of(body: Body, options: Ros2Options) -> dict[str, Reader]:
    """Return a reader for each topic of a sensor of the body, by the topic's name within the namespace."""
    readers: dict[str, Reader] = {}
    if body.scan or body.proximity:
        readers[options.scan_topic] = LaserReader(body, radians(body.ros2.scan_frame_deg + options.scanner_deg))
    if body.odometry and wheel_base_of(body.drive) > 0.0:
        readers[options.odometry_topic] = OdometryReader(wheel_base_of(body.drive), body.max_linear_mps)
    if "imu" in body.sensors or body.compass:
        readers[options.imu_topic] = ImuReader(options.north_deg, is_apart=len(motion_sensors(body)) > 1)
    battery = body.battery
    if battery:
        readers[options.battery_topic] = BatteryReader(battery)
    if body.ros2.create3 and body.ground:
        readers |= {options.hazard_topic: HazardReader(), options.cliff_topic: CliffReader(body.ground)}
    if body.light:
        value = body.light.blank("light", 1)["light.value"]
        for cell, topic in enumerate(topics_of_light(options.light_topic, value.shape[1])):
            readers[topic] = LightReader(value, cell, options.full_lux)
    return readers
