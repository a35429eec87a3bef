"""The messages as pycdr2 lays them out: a second opinion on every frame that goes to ROS 2 or comes from it.

Each is written out as its .msg file is, what they have in common, too: to be held against that line by line.
"""

import sys
from dataclasses import dataclass, field

from pycdr2 import IdlStruct
from pycdr2.types import array, float32, float64, int16, int32, sequence, uint8, uint32

if sys.version_info >= (3, 14):  # annotations are evaluated when they are read; pycdr2's empty dict would hide them
    PREPARE = type(IdlStruct).__prepare__

    def _prepare(_, name, bases, **keywords):
        namespace = PREPARE(name, bases, **keywords)
        del namespace["__annotations__"]
        return namespace

    type(IdlStruct).__prepare__ = classmethod(_prepare)


@dataclass
class Time(IdlStruct, typename="builtin_interfaces/msg/Time"):
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename="std_msgs/msg/Header"):
    stamp: Time
    frame_id: str


@dataclass
class MultiArrayDimension(IdlStruct, typename="std_msgs/msg/MultiArrayDimension"):
    label: str
    size: uint32
    stride: uint32


@dataclass
class MultiArrayLayout(IdlStruct, typename="std_msgs/msg/MultiArrayLayout"):
    dim: sequence[MultiArrayDimension] = field(default_factory=list)  # pyright: ignore[reportAssignmentType]
    data_offset: uint32 = 0


@dataclass
class UInt8MultiArray(IdlStruct, typename="std_msgs/msg/UInt8MultiArray"):
    layout: MultiArrayLayout = field(default_factory=MultiArrayLayout)
    data: sequence[uint8] = field(default_factory=list)  # pyright: ignore[reportAssignmentType]


@dataclass
class Vector3(IdlStruct, typename="geometry_msgs/msg/Vector3"):
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@dataclass
class Point(IdlStruct, typename="geometry_msgs/msg/Point"):
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs/msg/Quaternion"):
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0
    w: float64 = 1.0


@dataclass
class Twist(IdlStruct, typename="geometry_msgs/msg/Twist"):
    linear: Vector3 = field(default_factory=Vector3)
    angular: Vector3 = field(default_factory=Vector3)


@dataclass
class TwistStamped(IdlStruct, typename="geometry_msgs/msg/TwistStamped"):
    header: Header
    twist: Twist


@dataclass
class Pose(IdlStruct, typename="geometry_msgs/msg/Pose"):
    position: Point
    orientation: Quaternion


@dataclass
class PoseStamped(IdlStruct, typename="geometry_msgs/msg/PoseStamped"):
    header: Header
    pose: Pose


@dataclass
class PoseWithCovariance(IdlStruct, typename="geometry_msgs/msg/PoseWithCovariance"):
    pose: Pose
    covariance: array[float64, 36]


@dataclass
class TwistWithCovariance(IdlStruct, typename="geometry_msgs/msg/TwistWithCovariance"):
    twist: Twist
    covariance: array[float64, 36]


@dataclass
class Odometry(IdlStruct, typename="nav_msgs/msg/Odometry"):
    header: Header
    child_frame_id: str
    pose: PoseWithCovariance
    twist: TwistWithCovariance


@dataclass
class LaserScan(IdlStruct, typename="sensor_msgs/msg/LaserScan"):
    header: Header
    angle_min: float32
    angle_max: float32
    angle_increment: float32
    time_increment: float32
    scan_time: float32
    range_min: float32
    range_max: float32
    ranges: sequence[float32]
    intensities: sequence[float32]


@dataclass
class Imu(IdlStruct, typename="sensor_msgs/msg/Imu"):
    header: Header
    orientation: Quaternion
    orientation_covariance: array[float64, 9]
    angular_velocity: Vector3
    angular_velocity_covariance: array[float64, 9]
    linear_acceleration: Vector3
    linear_acceleration_covariance: array[float64, 9]


@dataclass
class BatteryState(IdlStruct, typename="sensor_msgs/msg/BatteryState"):
    header: Header
    voltage: float32
    temperature: float32
    current: float32
    charge: float32
    capacity: float32
    design_capacity: float32
    percentage: float32
    power_supply_status: uint8
    power_supply_health: uint8
    power_supply_technology: uint8
    present: bool
    cell_voltage: sequence[float32]
    cell_temperature: sequence[float32]
    location: str
    serial_number: str


@dataclass
class Illuminance(IdlStruct, typename="sensor_msgs/msg/Illuminance"):
    header: Header
    illuminance: float64
    variance: float64


@dataclass
class Clock(IdlStruct, typename="rosgraph_msgs/msg/Clock"):
    clock: Time


@dataclass
class Transform(IdlStruct, typename="geometry_msgs/msg/Transform"):
    translation: Vector3
    rotation: Quaternion


@dataclass
class TransformStamped(IdlStruct, typename="geometry_msgs/msg/TransformStamped"):
    header: Header
    child_frame_id: str
    transform: Transform


@dataclass
class TFMessage(IdlStruct, typename="tf2_msgs/msg/TFMessage"):
    transforms: sequence[TransformStamped]


@dataclass
class Range(IdlStruct, typename="sensor_msgs/msg/Range"):
    """From Iron on; before, without variance."""

    header: Header
    radiation_type: uint8
    field_of_view: float32
    min_range: float32
    max_range: float32
    range: float32
    variance: float32


@dataclass
class JointState(IdlStruct, typename="sensor_msgs/msg/JointState"):
    header: Header
    name: sequence[str]
    position: sequence[float64]
    velocity: sequence[float64]
    effort: sequence[float64]


@dataclass
class HazardDetection(IdlStruct, typename="irobot_create_msgs/msg/HazardDetection"):
    header: Header
    type: uint8


@dataclass
class HazardDetectionVector(IdlStruct, typename="irobot_create_msgs/msg/HazardDetectionVector"):
    header: Header
    detections: sequence[HazardDetection]


@dataclass
class IrIntensity(IdlStruct, typename="irobot_create_msgs/msg/IrIntensity"):
    header: Header
    value: int16


@dataclass
class IrIntensityVector(IdlStruct, typename="irobot_create_msgs/msg/IrIntensityVector"):
    header: Header
    readings: sequence[IrIntensity]


@dataclass
class DockStatus(IdlStruct, typename="irobot_create_msgs/msg/DockStatus"):
    header: Header
    dock_visible: bool
    is_docked: bool


@dataclass
class StopStatus(IdlStruct, typename="irobot_create_msgs/msg/StopStatus"):
    header: Header
    is_stopped: bool


@dataclass
class WheelTicks(IdlStruct, typename="irobot_create_msgs/msg/WheelTicks"):
    header: Header
    ticks_left: int32
    ticks_right: int32


@dataclass
class WheelVels(IdlStruct, typename="irobot_create_msgs/msg/WheelVels"):
    header: Header
    velocity_left: float32
    velocity_right: float32


KINDS = (
    *(Twist, TwistStamped, Odometry, LaserScan, Imu, BatteryState, Illuminance, Clock, TFMessage, Range, JointState),
    *(PoseStamped, HazardDetectionVector, IrIntensityVector, DockStatus, StopStatus, WheelTicks, WheelVels),
)
BY_KIND = {kind.__idl_typename__: kind for kind in KINDS}


def header(stamp_ns: int = 0, frame: str = "") -> Header:
    return Header(Time(stamp_ns // 10**9, stamp_ns % 10**9), frame)


def stamp_ns(header: Header) -> int:
    return header.stamp.sec * 10**9 + header.stamp.nanosec


def twist(linear_mps: float, angular_radps: float, lateral_mps: float = 0.0) -> Twist:
    return Twist(Vector3(linear_mps, lateral_mps), Vector3(z=angular_radps))


def laser_scan(ranges, first_rad=0.0, step_rad=None, range_min=0.1, range_max=10.0) -> LaserScan:
    step_rad = 6.283185307179586 / len(ranges) if step_rad is None else step_rad
    last_rad = first_rad + step_rad * (len(ranges) - 1)
    return LaserScan(header(), first_rad, last_rad, step_rad, 0.0, 0.2, range_min, range_max, list(ranges), [])


def odometry(x_m: float, y_m: float, orientation: Quaternion, at_ns: int) -> Odometry:
    pose = PoseWithCovariance(Pose(Point(x_m, y_m), orientation), [0.0] * 36)
    return Odometry(header(at_ns, "odom"), "base", pose, TwistWithCovariance(twist(0.0, 0.0), [0.0] * 36))
