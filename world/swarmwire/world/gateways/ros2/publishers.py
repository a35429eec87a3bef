"""The topics of emulated ROS 2 bases, from the readings of their group, and the options of the ROS 2 gateway."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isnan, nan
from typing import Any

import numpy as np

from swarmwire.comms.base.config import parameter
from swarmwire.comms.protocols.ros2.keys import (
    BATTERY_STATE,
    ILLUMINANCE,
    IMU,
    LASER_SCAN,
    RANGE,
    TRANSFORMS,
    Qos,
)
from swarmwire.comms.protocols.ros2.laser import laser_scan
from swarmwire.comms.protocols.ros2.messages import DISTROS, DOCK_STATUS, HAZARDS, INTENSITIES, Messages
from swarmwire.comms.protocols.ros2.motion import Motion, imu, motion_sensors, motion_variance
from swarmwire.comms.protocols.ros2.readings import (
    FULL_LUX,
    battery_state,
    cliff_intensities,
    dock_status,
    hazards,
    illuminance,
    topics_of_light,
)
from swarmwire.comms.protocols.ros2.transforms import (
    proximity_range,
    proximity_topics,
    sensor_frames,
    transforms,
)
from swarmwire.comms.robot.bodies.body import Body
from swarmwire.comms.robot.bodies.ros2_names import Ros2Names
from swarmwire.comms.robot.sensors.rays import ProximitySpec
from swarmwire.comms.robot.sensors.scan import ScanSpec
from swarmwire.world.gateways.ros2.base import Broadcaster, Fields
from swarmwire.world.gateways.ros2.wheels import wheel_broadcasters


@dataclass(frozen=True)
class Ros2GatewayOptions:
    """The protocol of the emulated bases, and the time-out of their commands."""

    domain: int = parameter(0, help="ROS_DOMAIN_ID of rmw_zenoh", at_least=0, at_most=232)
    distro: str = parameter("jazzy", help="distribution of ROS 2 whose nodes drive the robots", choices=DISTROS)
    stamped: bool = parameter(False, help="announce cmd_vel as TwistStamped, not Twist; both are always accepted")
    cmd_timeout_s: float = parameter(0.5, help="a base stops after this time without a command", unit="s", above=0)
    full_lux: float = parameter(
        FULL_LUX, help="illuminance that a photocell reports where it reads 1", unit="lx", above=0
    )
    north_deg: float = parameter(0.0, help="heading in the arena at which the IMU's yaw is 0", unit="deg")


MOTION_READS = ("imu.forward_mps2", "imu.left_mps2", "imu.turn_radps", "compass.heading_rad")  # order of `Motion`
LATCHED_RATE_HZ = 1.0  # rate of constant messages
STATUS_RATE_HZ = 1.0  # rate of the dock's status
HAZARD_QOS = Qos(depth=5)  # create3_sim: hazards_vector_publisher.cpp


class ScanBroadcaster(Broadcaster):
    """`scan` as LaserScan."""

    kind = LASER_SCAN
    reads = ("scan.range_m",)
    topic = "scan"

    def __init__(self, spec: ScanSpec, names: Ros2Names) -> None:
        self._spec, self._names, self.rate_hz = spec, names, spec.rate_hz

    def message(self, messages: Messages, fields: Fields, base: int, stamp_ns: int) -> Any:
        """See `Broadcaster.message`."""
        return laser_scan(messages, self._spec, self._names, fields["scan.range_m"][base], stamp_ns)


class SensorFrameBroadcaster(Broadcaster):
    """`tf_static`: the frames of the sensors, repeated for subscribers that do not ask for earlier messages."""

    kind = TRANSFORMS
    reads = ()
    topic = "tf_static"
    rate_hz = LATCHED_RATE_HZ
    qos = Qos(depth=1, latched=True)

    def __init__(self, body: Body) -> None:
        self._frames = sensor_frames(body)

    def is_published(self, fields: Fields) -> bool:
        """See `Broadcaster.is_published`."""
        return True

    def message(self, messages: Messages, fields: Fields, base: int, stamp_ns: int) -> Any:
        """See `Broadcaster.message`."""
        return transforms(messages, self._frames, stamp_ns)


class ProximityBroadcaster(Broadcaster):
    """One sensor of `proximity` as Range."""

    kind = RANGE
    reads = ("proximity.value",)

    def __init__(self, spec: ProximitySpec, topic: str, index: int) -> None:
        self.topic, self.rate_hz = topic, spec.rate_hz
        self._spec, self._index = spec, index

    def message(self, messages: Messages, fields: Fields, base: int, stamp_ns: int) -> Any | None:
        """See `Broadcaster.message`."""
        value = float(fields["proximity.value"][base, self._index])
        return None if isnan(value) else proximity_range(messages, self._spec, value, self.topic, stamp_ns)


class ImuBroadcaster(Broadcaster):
    """`imu`, `compass` or both, with the same rate, as Imu."""

    kind = IMU
    topic = "imu"

    def __init__(self, body: Body, sensors: Sequence[str], north_deg: float) -> None:
        self.reads = tuple(name for name in MOTION_READS if name.partition(".")[0] in sensors)
        self.rate_hz = body.sensors[sensors[0]].rate_hz
        self._north_deg, self._variance = north_deg, motion_variance(body)

    def message(self, messages: Messages, fields: Fields, base: int, stamp_ns: int) -> Any | None:
        """See `Broadcaster.message`."""
        present = fields.keys() & self.reads
        motion = Motion(*(float(fields[name][base]) if name in present else nan for name in MOTION_READS))
        return None if all(map(isnan, motion)) else imu(messages, motion, self._north_deg, stamp_ns, self._variance)


class BatteryBroadcaster(Broadcaster):
    """`battery` as BatteryState."""

    kind = BATTERY_STATE
    reads = ("battery.charge", "battery.voltage_v")
    topic = "battery_state"

    def __init__(self, rate_hz: float) -> None:
        self.rate_hz = rate_hz

    def message(self, messages: Messages, fields: Fields, base: int, stamp_ns: int) -> Any | None:
        """See `Broadcaster.message`."""
        charge, voltage_v = float(fields["battery.charge"][base]), float(fields["battery.voltage_v"][base])
        return None if isnan(charge + voltage_v) else battery_state(messages, charge, voltage_v, stamp_ns)


class LightBroadcaster(Broadcaster):
    """One cell of `light` as Illuminance."""

    kind = ILLUMINANCE
    reads = ("light.value",)

    def __init__(self, topic: str, rate_hz: float, cell: int, full_lux: float) -> None:
        self.topic, self.rate_hz = topic, rate_hz
        self._cell, self._full_lux = cell, full_lux

    def message(self, messages: Messages, fields: Fields, base: int, stamp_ns: int) -> Any:
        """See `Broadcaster.message`."""
        brightness = float(fields["light.value"][base, self._cell])
        return illuminance(messages, brightness, self._full_lux, self.topic, stamp_ns)


class HazardBroadcaster(Broadcaster):
    """`bumper` and `ground` as HazardDetectionVector, in each tick; a lost reading is no hazard."""

    kind = HAZARDS
    reads = ("bumper.pressed", "ground.shade")
    topic = "hazard_detection"
    rate_hz = 0.0
    qos = HAZARD_QOS

    def message(self, messages: Messages, fields: Fields, base: int, stamp_ns: int) -> Any:
        """See `Broadcaster.message`."""
        pressed = bool(fields["bumper.pressed"][base] > 0.0)
        return hazards(messages, pressed=pressed, shade=fields["ground.shade"][base], stamp_ns=stamp_ns)


class CliffBroadcaster(Broadcaster):
    """`ground` as IrIntensityVector."""

    kind = INTENSITIES
    reads = ("ground.shade",)
    topic = "cliff_intensity"

    def __init__(self, rate_hz: float) -> None:
        self.rate_hz = rate_hz

    def message(self, messages: Messages, fields: Fields, base: int, stamp_ns: int) -> Any | None:
        """See `Broadcaster.message`."""
        shade = fields["ground.shade"][base]
        return None if np.isnan(shade).any() else cliff_intensities(messages, shade, stamp_ns)


class DockBroadcaster(Broadcaster):
    """`dock_status` of a base that has no dock."""

    kind = DOCK_STATUS
    reads = ()
    topic = "dock_status"
    rate_hz = STATUS_RATE_HZ

    def is_published(self, fields: Fields) -> bool:
        """See `Broadcaster.is_published`."""
        return True

    def message(self, messages: Messages, fields: Fields, base: int, stamp_ns: int) -> Any:
        """See `Broadcaster.message`."""
        return dock_status(messages, stamp_ns)


def broadcasters_of(body: Body, bases: int, options: Ros2GatewayOptions) -> tuple[Broadcaster, ...]:
    """Return the topics of bases with this body."""
    broadcasters: list[Broadcaster] = []
    if body.scan:
        broadcasters.append(ScanBroadcaster(body.scan, body.ros2))
    broadcasters += wheel_broadcasters(body, bases)
    if body.ros2.create3 and body.ground:
        broadcasters += [HazardBroadcaster(), CliffBroadcaster(body.ground.rate_hz), DockBroadcaster()]
    if body.proximity:
        topics = proximity_topics(len(body.proximity.angle_rad))
        broadcasters += [ProximityBroadcaster(body.proximity, topic, index) for index, topic in enumerate(topics)]
    broadcasters += [ImuBroadcaster(body, sensors, options.north_deg) for sensors in motion_sensors(body)]
    if "battery" in body.sensors:
        broadcasters.append(BatteryBroadcaster(body.sensors["battery"].rate_hz))
    if body.light:
        topics = topics_of_light("illuminance", len(body.light.angle_rad))
        broadcasters.extend(
            LightBroadcaster(t, body.light.rate_hz, cell, options.full_lux) for cell, t in enumerate(topics)
        )
    broadcasters.append(SensorFrameBroadcaster(body))
    return tuple(broadcasters)
