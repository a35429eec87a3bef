"""Bodies: kinds of robot, each read from a TOML file and checked; `bodies/` holds the bundled ones.

A body file with `like = "epuck"` starts from that body, table by table, and states the differences only; without a
name of its own the body has the name of its file. The specs of its drive, its LEDs and its custom sensors and actuators
are in the other modules of this package, those of its sensors in `swarmwire.comms.robot.sensors`.
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
from swarmwire.comms.robot.bodies.tables import built, mapping_of
from swarmwire.comms.robot.sensors import SENSOR_SPECS
from swarmwire.comms.robot.sensors.light import LightSpec
from swarmwire.comms.robot.sensors.rays import InfraredSpec, ProximitySpec
from swarmwire.comms.robot.sensors.scan import ScanSpec
from swarmwire.comms.robot.sensors.sensor import SensorSpec
from swarmwire.comms.robot.sensors.simple import CompassSpec, GroundSpec, OdometrySpec

S = TypeVar("S", bound=SensorSpec)
HERE = Path()
MOTORS, WHEELS = "motors", ("left_wheel", "right_wheel")  # parts that the event `fail` names; no sensor has these names
CREATE3_CLIFF_SENSORS = 4
MAX_LED_RADIUS_RATIO = 1.25  # of a LED ring to the body: the ring of ARGoS's e-puck stands out by a fifth
MAX_LED_HEIGHT_RATIO = 2.0  # of a LED to the body: the foot-bot's beacon stands on a pole


class IncompatibleBody(AttributeError):
    """An agent uses a part that the body does not have: wheels, LEDs."""


@dataclass(frozen=True)
class Body:
    """A disc-shaped robot: its size, drive, LEDs, sensors, custom actuators and names in ROS 2."""

    name: str = parameter(help="name in scenarios")
    source: str = parameter(help="where the figures come from")
    radius_m: float = parameter(help="radius of the body", unit="m", above=0)
    height_m: float = parameter(help="height of the body", unit="m", above=0)
    mass_kg: float = parameter(help="mass", unit="kg", above=0)
    drive: Drive = parameter(help="how it moves")
    altitude_m: float = parameter(0.0, help="height of its lower side above the floor", unit="m", at_least=0)
    contacts: bool = parameter(True, help="whether others and obstacles stop it; false: it passes through them")
    leds: Leds | None = None
    ros2: Ros2Names = DEFAULT_NAMES
    sensors: dict[str, SensorSpec] = field(default_factory=dict[str, SensorSpec])
    actuators: dict[str, CustomActuatorSpec] = field(default_factory=dict[str, CustomActuatorSpec])

    @cached_property
    def proximity(self) -> ProximitySpec | None:
        """The spec of the proximity sensors; None: no such sensor, here and below."""
        return self.spec_of(ProximitySpec)

    @cached_property
    def compass(self) -> CompassSpec | None:
        """The spec of the compass."""
        return self.spec_of(CompassSpec)

    @cached_property
    def odometry(self) -> OdometrySpec | None:
        """The spec of the wheel encoders."""
        return self.spec_of(OdometrySpec)

    @cached_property
    def light(self) -> LightSpec | None:
        """The spec of the light sensors."""
        return self.spec_of(LightSpec)

    @cached_property
    def infrared(self) -> InfraredSpec | None:
        """The spec of the passive infrared sensors."""
        return self.spec_of(InfraredSpec)

    @cached_property
    def scan(self) -> ScanSpec | None:
        """The spec of the laser scanner."""
        return self.spec_of(ScanSpec)

    @cached_property
    def ground(self) -> GroundSpec | None:
        """The spec of the ground sensors."""
        return self.spec_of(GroundSpec)

    @cached_property
    def actuator_slices(self) -> dict[str, slice]:
        """The slice of each actuator, by name, in the numbers of all actuators."""
        slices: dict[str, slice] = {}
        start = 0
        for name, spec in self.actuators.items():
            slices[name] = slice(start, start + spec.width)
            start += spec.width
        return slices

    def spec_of(self, kind: type[S]) -> S | None:
        """The spec of this kind of sensor; None if the body has none."""
        return next((spec for spec in self.sensors.values() if isinstance(spec, kind)), None)

    @property
    def wheels(self) -> Wheels | Twist:
        """The drive of a body with two wheels; IncompatibleBody if it has another drive."""
        if isinstance(self.drive, Holonomic):
            raise IncompatibleBody(f"the body {self.name} has no wheels: its drive is {self.drive.kind}")
        return self.drive

    @property
    def led_count(self) -> int:
        """Number of LEDs."""
        return 0 if self.leds is None else self.leds.count

    @cached_property
    def led_positions_m(self) -> FloatArray:
        """The positions of its LEDs: x ahead, y to the left, z above its lower side, (leds, 3)."""
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
        """The body as agents get it: without the classes and the parameters of custom sensors and actuators.

        The parameters may reveal facts of the arena, and the path of a file those of its machine.
        """
        hidden: dict[str, Any] = {"kind": "", "params": {}}
        sensors = {n: replace(s, **hidden) if isinstance(s, CustomSensorSpec) else s for n, s in self.sensors.items()}
        actuators = {name: replace(spec, **hidden) for name, spec in self.actuators.items()}
        return replace(self, sensors=sensors, actuators=actuators)

    def as_mapping(self) -> dict[str, Any]:
        """The body as plain values, which `body_from_mapping` reads back."""
        return asdict(self)


def body_names() -> list[str]:
    """The names of the bundled bodies."""
    entries = (entry.name for entry in files("swarmwire.comms.robot.bodies").iterdir())
    return sorted(name.removesuffix(".toml") for name in entries if name.endswith(".toml"))


@cache
def load_body(name: str) -> Body:
    """A bundled body by name; BadInput if there is none. Every call returns the same object."""
    return body_from(_bundled(name, "", "body"), where=f"{name}.toml")


def body_from(spec: Mapping[str, Any], where: str, beside: Path = HERE) -> Body:
    """The body of the table `spec`; BadInput names `where` and the key of a fault.

    The files of custom sensors and actuators are in the folder `beside`.
    """
    like, changes = spec.get("like"), {key: value for key, value in spec.items() if key != "like"}
    if like is not None:
        base = _bundled(like, where, "like")
        base["name"] = Path(where).stem  # a record could not distinguish two bodies of one name
        if _drive_kind(changes, _drive_kind(base)) != _drive_kind(base):
            base.pop("drive", None)  # another kind of drive: its limits have other names
        return body_from(_with_changes(base, changes), where, beside)
    return _body(changes, where, beside)


def body_from_mapping(mapping: Mapping[str, Any], where: str) -> Body:
    """The body that `as_mapping` wrote down; BadInput names `where` and the key of a fault."""
    return _body(dict(mapping), where, None)


def merged(base: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """`base` with the values of `over` in place of its own; tables that both have are merged."""
    tables = {key for key in over if isinstance(over[key], Mapping) and isinstance(base.get(key), Mapping)}
    return {**base, **over, **{key: merged(base[key], over[key]) for key in tables}}


def _body(table: dict[str, Any], where: str, beside: Path | None) -> Body:
    """The body of a complete table; `beside` None: the table is from `as_mapping`."""
    sensors = mapping_of(where, "sensors", table.pop("sensors", {}))
    table["sensors"] = {name: _sensor(name, spec, where, beside) for name, spec in sensors.items()}
    actuators = mapping_of(where, "actuators", table.pop("actuators", {}))
    table["actuators"] = {name: _actuator(name, spec, where, beside) for name, spec in actuators.items()}
    if "drive" in table:
        table["drive"] = _drive(table["drive"], where)
    if table.get("leds") is not None:  # None: from `as_mapping`
        table["leds"] = built(Leds, table["leds"], where, "leds")
    body: Body = built(Body, table, where, "")
    fault = fault_of_body(body)
    if fault:
        raise BadInput(where, *fault)
    return body


def _with_changes(base: dict[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """`base` with the changes; sensors of `base` that the changed body does not support are dropped."""
    table = merged(base, changes)
    changed_sensors = changes.get("sensors", {})
    if isinstance(table.get("sensors"), dict):
        for name in unsupported_sensors(_drive_kind(table), table.get("altitude_m", 0.0)):
            if name not in changed_sensors:
                table["sensors"].pop(name, None)
    return table


def _sensor(name: str, table: object, where: str, beside: Path | None) -> SensorSpec:
    key = f"sensors.{name}"
    if name in (MOTORS, *WHEELS):
        raise BadInput(where, key, f"expected another name: {name} is a part of the drive, which the event fail names")
    if name in SENSOR_SPECS:
        return built(SENSOR_SPECS[name], table, where, key)
    if "kind" not in mapping_of(where, key, table) or not name.isidentifier():
        expected = f'expected {did_you_mean(SENSOR_SPECS, name)}, or a kind = "file.py:Class" of your own'
        raise BadInput(where, key, f"unknown sensor; {expected}")
    return (
        read_custom_sensor_spec(table, where, key) if beside is None else custom_sensor_spec(table, where, key, beside)
    )


def _actuator(name: str, table: object, where: str, beside: Path | None) -> CustomActuatorSpec:
    key = f"actuators.{name}"
    if not name.isidentifier():
        raise BadInput(where, key, "expected a name of letters, digits and _, which does not start with a digit")
    return (
        read_custom_actuator_spec(table, where, key)
        if beside is None
        else custom_actuator_spec(table, where, key, beside)
    )


def _drive_kind(spec: Mapping[str, Any], default: object = "wheels") -> object:
    """The kind of drive in a body's table."""
    drive: object = spec.get("drive")
    return cast("Mapping[str, object]", drive).get("kind", default) if isinstance(drive, Mapping) else default


def _drive(value: object, where: str) -> Drive:
    table = mapping_of(where, "drive", value)
    kind = table.get("kind", "wheels")
    if not isinstance(kind, str) or kind not in DRIVES:
        raise BadInput(where, "drive.kind", f"expected one of {', '.join(DRIVES)}; got {kind!r}")
    return built(DRIVES[kind], table, where, "drive")


def _bundled(name: object, where: str, key: str) -> dict[str, Any]:
    """The table of a bundled body; BadInput with `where` and `key` if there is none."""
    if name not in body_names():
        raise BadInput(where, key, f"expected {did_you_mean(body_names(), name)}; got {name!r}")
    return tomllib.loads(files("swarmwire.comms.robot.bodies").joinpath(f"{name}.toml").read_text(encoding="utf-8"))


def fault_of_body(body: Body) -> tuple[str, str] | None:
    """The key of the first value that contradicts the others, and the expectation; None if there is none."""
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
    """The sensors that a body with this kind of drive at this altitude cannot have, each with the reason."""
    at_m = float(altitude_m) if isinstance(altitude_m, int | float) else 0.0
    reasons = {name: kind.unsupported(drive, at_m) for name, kind in SENSOR_SPECS.items()}
    return {name: reason for name, reason in reasons.items() if reason}


def _fault_of_create3(body: Body) -> str | None:
    """The expectation, if the body lacks what every Create 3 tells of."""
    cliffs = 0 if body.ground is None else len(body.ground.points_m)
    if body.odometry and wheel_radius_of(body.drive) and "bumper" in body.sensors and cliffs == CREATE3_CLIFF_SENSORS:
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
