"""Bodies: kinds of robot, each read from a TOML file and checked. The files of the bundled bodies are in this package.

A body file with `like = "epuck"` starts from that body, table by table, and states only the differences; without a
`name`, the body has the name of its file. Specs of drives, LEDs, and custom sensors and actuators are in the other
modules of this package, specs of built-in sensors in `swarmwire.comms.robot.sensors`.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cache, cached_property
from importlib.resources import files
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.config import did_you_mean, parameter
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.robot.bodies.custom import (
    CustomActuatorSpec,
    CustomSensorSpec,
    custom_actuator_spec,
    custom_sensor_spec,
    read_custom_actuator_spec,
    read_custom_sensor_spec,
)
from swarmwire.comms.robot.bodies.drives import DRIVES, Drive, Holonomic, Leds, Twist, Wheels, wheel_radius_of
from swarmwire.comms.robot.bodies.ros2_names import DEFAULT_NAMES, Ros2Names
from swarmwire.comms.robot.bodies.tables import mapping_of, parse_table
from swarmwire.comms.robot.sensors import SENSOR_SPECS
from swarmwire.comms.robot.sensors.camera import CameraSpec
from swarmwire.comms.robot.sensors.imu import ImuSpec
from swarmwire.comms.robot.sensors.light import LightSpec
from swarmwire.comms.robot.sensors.rays import InfraredSpec, ProximitySpec
from swarmwire.comms.robot.sensors.scan import ScanSpec
from swarmwire.comms.robot.sensors.sensor import SensorSpec
from swarmwire.comms.robot.sensors.simple import (
    BatterySpec,
    BumperSpec,
    CompassSpec,
    FlowSpec,
    GroundSpec,
    OdometrySpec,
    PositioningSpec,
)

S = TypeVar("S", bound=SensorSpec)
CURRENT_FOLDER = Path()
MOTORS, WHEELS = "motors", ("left_wheel", "right_wheel")  # parts that the event `fail` names; no sensor has these names
CREATE3_CLIFF_SENSORS = 4
MAX_LED_RADIUS_RATIO = 1.25  # LED ring to body: the ring of ARGoS's e-puck is a fifth larger than the body
MAX_LED_HEIGHT_RATIO = 2.0  # LED to body: the foot-bot's beacon stands on a pole


class IncompatibleBody(AttributeError):
    """An agent uses a part that the body does not have: wheels, LEDs."""


def _spec_property(kind: type[S]) -> "cached_property[S | None]":
    """Make the property of a body that holds the spec of this kind of sensor; None if the body has no such sensor."""

    def find(body: "Body") -> S | None:
        """The spec of this sensor; None if the body has no such sensor."""
        return next((spec for spec in body.sensors.values() if isinstance(spec, kind)), None)

    return cached_property(find)


@dataclass(frozen=True)
class Body:
    """A disc-shaped robot: its size, drive, LEDs, sensors, custom actuators and names in ROS 2.

    The property of each built-in sensor (`proximity`, `compass`, …) is its spec; None if the body has no such sensor.
    """

    name: str = parameter(help="name in scenarios")
    source: str = parameter(help="source of the figures")
    radius_m: float = parameter(help="radius of the body", unit="m", above=0)
    height_m: float = parameter(help="height of the body", unit="m", above=0)
    mass_kg: float = parameter(help="mass", unit="kg", above=0)
    drive: Drive = parameter(help="drive of the body")
    altitude_m: float = parameter(0.0, help="height of its lower side above the floor", unit="m", at_least=0)
    contacts: bool = parameter(True, help="true: robots and obstacles stop it; false: it passes through them")
    leds: Leds | None = None
    ros2: Ros2Names = DEFAULT_NAMES
    sensors: dict[str, SensorSpec] = field(default_factory=dict[str, SensorSpec])
    actuators: dict[str, CustomActuatorSpec] = field(default_factory=dict[str, CustomActuatorSpec])

    proximity = _spec_property(ProximitySpec)
    compass = _spec_property(CompassSpec)
    odometry = _spec_property(OdometrySpec)
    light = _spec_property(LightSpec)
    bumper = _spec_property(BumperSpec)
    positioning = _spec_property(PositioningSpec)
    infrared = _spec_property(InfraredSpec)
    scan = _spec_property(ScanSpec)
    ground = _spec_property(GroundSpec)
    camera = _spec_property(CameraSpec)
    imu = _spec_property(ImuSpec)
    battery = _spec_property(BatterySpec)
    flow = _spec_property(FlowSpec)

    @cached_property
    def actuator_slices(self) -> dict[str, slice]:
        """The slice of each custom actuator, by name, in an array of the numbers of all custom actuators."""
        slices: dict[str, slice] = {}
        start = 0
        for name, spec in self.actuators.items():
            slices[name] = slice(start, start + spec.width)
            start += spec.width
        return slices

    @property
    def wheels(self) -> Wheels | Twist:
        """The drive of a body with two wheels; IncompatibleBody if the body has another drive."""
        if isinstance(self.drive, Holonomic):
            raise IncompatibleBody(f"the body {self.name} has no wheels: its drive is {self.drive.kind}")
        return self.drive

    @property
    def led_count(self) -> int:
        """Number of LEDs."""
        return 0 if self.leds is None else self.leds.count

    @cached_property
    def led_positions_m(self) -> FloatArray:
        """Positions of the LEDs: x ahead, y to the left, z above the body's lower side, (leds, 3)."""
        return np.empty((0, 3)) if self.leds is None else self.leds.positions_m(self.radius_m)

    @property
    def max_linear_mps(self) -> float:
        """Largest forward speed."""
        return self.drive.max_linear_mps

    @property
    def max_angular_radps(self) -> float:
        """Largest turn rate on the spot."""
        return self.drive.max_angular_radps

    @property
    def agent_view(self) -> "Body":
        """The body for agents, without the classes and the parameters of custom sensors and actuators.

        Parameters may reveal facts of the arena; the path of a file reveals facts of its machine.
        """
        hidden: dict[str, Any] = {"kind": "", "params": {}}
        sensors = {
            name: replace(spec, **hidden) if isinstance(spec, CustomSensorSpec) else spec
            for name, spec in self.sensors.items()
        }
        actuators = {name: replace(spec, **hidden) for name, spec in self.actuators.items()}
        return replace(self, sensors=sensors, actuators=actuators)

    def as_mapping(self) -> dict[str, Any]:
        """Return the body as plain values for `body_from_mapping`."""
        return asdict(self)


def body_names() -> list[str]:
    """Return the names of the bundled bodies."""
    entries = (entry.name for entry in files("swarmwire.comms.robot.bodies").iterdir())
    return sorted(name.removesuffix(".toml") for name in entries if name.endswith(".toml"))


@cache
def load_body(name: str) -> Body:
    """Return the bundled body of this name; BadInput if there is none. Every call returns the same object."""
    return body_from(_bundled(name, "", "body"), where=f"{name}.toml")


def body_from(spec: Mapping[str, Any], where: str, folder: Path = CURRENT_FOLDER) -> Body:
    """Make the body of the table `spec`; BadInput names `where` and the key of a fault.

    Paths of custom sensors and actuators are relative to `folder`.
    """
    like, changes = spec.get("like"), {key: value for key, value in spec.items() if key != "like"}
    if like is not None:
        base = _bundled(like, where, "like")
        base["name"] = Path(where).stem  # a record could not distinguish two bodies of one name
        if _drive_kind(changes, _drive_kind(base)) != _drive_kind(base):
            base.pop("drive", None)  # another kind of drive has other keys
        return body_from(_with_changes(base, changes), where, folder)
    return _body(changes, where, folder)


def body_from_mapping(mapping: Mapping[str, Any], where: str) -> Body:
    """Make the body from the result of `as_mapping`; BadInput names `where` and the key of a fault."""
    return _body(dict(mapping), where, None)


def merged(base: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """Return `base` updated with `over`; a table in both is merged in the same way."""
    tables = {key for key in over if isinstance(over[key], Mapping) and isinstance(base.get(key), Mapping)}
    return {**base, **over, **{key: merged(base[key], over[key]) for key in tables}}


def _body(table: dict[str, Any], where: str, folder: Path | None) -> Body:
    """Make the body of a complete table; `folder` is None if the table is from `as_mapping`."""
    sensors = mapping_of(where, "sensors", table.pop("sensors", {}))
    table["sensors"] = {name: _sensor(name, spec, where, folder) for name, spec in sensors.items()}
    actuators = mapping_of(where, "actuators", table.pop("actuators", {}))
    table["actuators"] = {name: _actuator(name, spec, where, folder) for name, spec in actuators.items()}
    if "drive" in table:
        table["drive"] = _drive(table["drive"], where)
    if table.get("leds") is not None:  # None: from `as_mapping`
        table["leds"] = parse_table(Leds, table["leds"], where, "leds")
    body: Body = parse_table(Body, table, where, "")
    fault = fault_of_body(body)
    if fault:
        raise BadInput(where, *fault)
    return body


def _with_changes(base: dict[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return `base` with the changes, without sensors of `base` that the changed body does not support."""
    table = merged(base, changes)
    changed_sensors = changes.get("sensors", {})
    if isinstance(table.get("sensors"), dict):
        for name in unsupported_sensors(_drive_kind(table), table.get("altitude_m", 0.0)):
            if name not in changed_sensors:
                table["sensors"].pop(name, None)
    return table


def _sensor(name: str, table: object, where: str, folder: Path | None) -> SensorSpec:
    key = f"sensors.{name}"
    if name in (MOTORS, *WHEELS):
        raise BadInput(where, key, f"expected another name: {name} is a part of the drive, which the event fail names")
    if name in SENSOR_SPECS:
        return parse_table(SENSOR_SPECS[name], table, where, key)
    if "kind" not in mapping_of(where, key, table) or not name.isidentifier():
        expected = f'expected {did_you_mean(SENSOR_SPECS, name)}, or a kind = "file.py:Class" of your own'
        raise BadInput(where, key, f"unknown sensor; {expected}")
    return (
        read_custom_sensor_spec(table, where, key) if folder is None else custom_sensor_spec(table, where, key, folder)
    )


def _actuator(name: str, table: object, where: str, folder: Path | None) -> CustomActuatorSpec:
    key = f"actuators.{name}"
    if not name.isidentifier():
        raise BadInput(where, key, "expected a name of letters, digits and _, which does not start with a digit")
    return (
        read_custom_actuator_spec(table, where, key)
        if folder is None
        else custom_actuator_spec(table, where, key, folder)
    )


def _drive_kind(spec: Mapping[str, Any], default: object = "wheels") -> object:
    """Return the kind of drive in a body's table."""
    drive: object = spec.get("drive")
    return cast("Mapping[str, object]", drive).get("kind", default) if isinstance(drive, Mapping) else default


def _drive(value: object, where: str) -> Drive:
    table = mapping_of(where, "drive", value)
    kind = table.get("kind", "wheels")
    if not isinstance(kind, str) or kind not in DRIVES:
        raise BadInput(where, "drive.kind", f"expected one of {', '.join(DRIVES)}; got {kind!r}")
    return parse_table(DRIVES[kind], table, where, "drive")


def _bundled(name: object, where: str, key: str) -> dict[str, Any]:
    """Read the table of a bundled body; BadInput with `where` and `key` if there is none."""
    if name not in body_names():
        raise BadInput(where, key, f"expected {did_you_mean(body_names(), name)}; got {name!r}")
    return tomllib.loads(files("swarmwire.comms.robot.bodies").joinpath(f"{name}.toml").read_text(encoding="utf-8"))


def fault_of_body(body: Body) -> tuple[str, str] | None:
    """Return the key of the first value that contradicts other values, and the expectation; None if none does."""
    diameter_m = 2.0 * body.radius_m
    if not isinstance(body.drive, Holonomic) and body.drive.wheel_base_m > diameter_m:
        expected = f"expected at most the body's diameter, {diameter_m:g} m; got {body.drive.wheel_base_m!r}"
        return "drive.wheel_base_m", expected
    if body.leds is not None and (fault := _fault_of_leds(body.leds, body.radius_m, body.height_m)):
        return fault
    if body.ros2.create3 and (fault := _fault_of_create3(body)):
        return "ros2.create3", fault
    unsupported = unsupported_sensors(body.drive.kind, body.altitude_m)
    for name, spec in body.sensors.items():
        if name in unsupported:
            return f"sensors.{name}", unsupported[name]
        if fault := spec.fault(body.radius_m):
            return f"sensors.{name}.{fault[0]}", fault[1]
    return None


def unsupported_sensors(drive: object, altitude_m: object) -> Mapping[str, str]:
    """Return the sensors that a body with this kind of drive at this altitude cannot have, each with the reason."""
    height_m = float(altitude_m) if isinstance(altitude_m, int | float) else 0.0
    reasons = {name: kind.unsupported(drive, height_m) for name, kind in SENSOR_SPECS.items()}
    return {name: reason for name, reason in reasons.items() if reason}


def _fault_of_create3(body: Body) -> str | None:
    """Return the expectation if the body lacks a part that every Create 3 has and publishes."""
    cliffs = 0 if body.ground is None else len(body.ground.points_m)
    if body.odometry and wheel_radius_of(body.drive) and body.bumper and cliffs == CREATE3_CLIFF_SENSORS:
        return None
    return (
        "expected sensors.odometry, drive.wheel_radius_m, sensors.bumper, and sensors.ground with the points of "
        f"{CREATE3_CLIFF_SENSORS} cliff sensors"
    )


def _fault_of_leds(leds: Leds, radius_m: float, height_m: float) -> tuple[str, str] | None:
    limits: dict[str, tuple[float, float, str]] = {
        "radius_m": (
            leds.radius_m,
            MAX_LED_RADIUS_RATIO * radius_m,
            f"{MAX_LED_RADIUS_RATIO:g} times the body's radius",
        ),
        "height_m": (leds.height_m, MAX_LED_HEIGHT_RATIO * height_m, "twice the body's height"),
        "beacon_height_m": (leds.beacon_height_m, MAX_LED_HEIGHT_RATIO * height_m, "twice the body's height"),
    }
    for key, (value, maximum, reason) in limits.items():
        if value > maximum:
            return f"leds.{key}", f"expected at most {maximum:g} m, {reason}; got {value!r}"
    return None
