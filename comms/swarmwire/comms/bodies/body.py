"""What in a body's sheet contradicts its size, its drive or how high it flies."""

import tomllib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cache, cached_property
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.bodies.custom import (
    CustomActuatorSpec,
    CustomSensorSpec,
    custom_actuator_spec,
    custom_sensor_spec,
    read_custom_actuator_spec,
    read_custom_sensor_spec,
)
from swarmwire.comms.bodies.drives import DRIVES, Drive, Holonomic, Leds, Twist, Wheels
from swarmwire.comms.bodies.ranging_specs import InfraredSpec, LightSpec, ProximitySpec, ScanSpec
from swarmwire.comms.bodies.sensor_specs import CompassSpec, OdometrySpec
from swarmwire.comms.bodies.sensors import SENSOR_SPECS
from swarmwire.comms.bodies.spec import SensorSpec
from swarmwire.comms.bodies.tables import built, mapping_of
from swarmwire.comms.config import did_you_mean, parameter
from swarmwire.comms.errors import BadInput

if TYPE_CHECKING:
    pass

MAX_OF_RADIUS = 1.25  # how far from the axis a ring of LEDs may be: that of ARGoS's e-puck stands out by a fifth
MAX_OF_HEIGHT = 2.0  # how high a LED may be: the foot-bot's beacon stands on a pole


def fault_of_body(body: "Body") -> tuple[str, str] | None:
    """The key of the first thing that does not go with the others, and what was expected; None if all do."""
    diameter_m = 2.0 * body.radius_m
    if not isinstance(body.drive, Holonomic) and body.drive.wheel_base_m > diameter_m:
        expected = f"expected at most the body's diameter, {diameter_m:g} m; got {body.drive.wheel_base_m!r}"
        return "drive.wheel_base_m", expected
    if body.leds is not None and (fault := _fault_of_leds(body.leds, body.radius_m, body.height_m)):
        return fault
    unfit = unsupported_sensors(body.drive.kind, body.altitude_m)
    for name, spec in body.sensors.items():
        if name in unfit:
            return f"sensors.{name}", unfit[name]
        if fault := spec.fault(body.radius_m):
            return f"sensors.{name}.{fault[0]}", fault[1]
    return None


def unsupported_sensors(drive: object, altitude_m: object) -> Mapping[str, str]:
    """The senses that a body with this kind of drive, at this altitude, cannot have, and why."""
    unfit: dict[str, str] = {}
    if drive == "holonomic":
        unfit["odometry"] = "expected a drive with wheels: holonomic has no wheels"
    if isinstance(altitude_m, int | float) and altitude_m > 0:
        unfit["ground"] = f"expected altitude_m = 0: it looks at the floor right below, not from {altitude_m:g} m"
    return unfit


def _fault_of_leds(leds: Leds, radius_m: float, height_m: float) -> tuple[str, str] | None:
    limits: dict[str, tuple[float, float, str]] = {
        "radius_m": (leds.radius_m, MAX_OF_RADIUS * radius_m, f"{MAX_OF_RADIUS:g} times the body's radius"),
        "height_m": (leds.height_m, MAX_OF_HEIGHT * height_m, "twice the body's height"),
        "beacon_height_m": (leds.beacon_height_m, MAX_OF_HEIGHT * height_m, "twice the body's height"),
    }
    for key, (value, most, what) in limits.items():
        if value > most:
            return f"leds.{key}", f"expected at most {most:g} m, {what}; got {value!r}"
    return None


# --- Bodies: kinds of robot, each a TOML data sheet. Those that come with swarmwire lie in `bodies/`.
#
# A sheet with `like = "epuck"` starts from that body's sheet, table by table, and says only what differs; without a
# name of its own it goes by its file's.


S = TypeVar("S", bound=SensorSpec)
HERE = Path()
MOTORS, WHEELS = "motors", ("left_wheel", "right_wheel")  # parts that can fail as senses can: no sense is named so


class IncompatibleBody(AttributeError):
    """The body does not have what an agent asks it for: wheels, LEDs."""


@dataclass(frozen=True)
class Body:
    """A disc-shaped robot: its size, drive and senses (a sense that is None it does not have)."""

    name: str = parameter(help="name in scenarios")
    source: str = parameter(help="where the figures come from")
    radius_m: float = parameter(help="radius of the body", unit="m", above=0)
    height_m: float = parameter(help="height of the body", unit="m", above=0)
    mass_kg: float = parameter(help="mass", unit="kg", above=0)
    drive: Drive = parameter(help="how it moves")
    altitude_m: float = parameter(0.0, help="height of its lower side above the floor", unit="m", at_least=0)
    contacts: bool = parameter(True, help="whether others and obstacles stop it; false: it passes through them")
    leds: Leds | None = None
    sensors: dict[str, SensorSpec] = field(default_factory=dict[str, SensorSpec])
    actuators: dict[str, CustomActuatorSpec] = field(default_factory=dict[str, CustomActuatorSpec])  # of the user's own

    @cached_property
    def proximity(self) -> ProximitySpec | None:
        """The proximity sensor's sheet."""
        return self._spec(ProximitySpec)

    @cached_property
    def compass(self) -> CompassSpec | None:
        """The compass's sheet."""
        return self._spec(CompassSpec)

    @cached_property
    def odometry(self) -> OdometrySpec | None:
        """The wheel encoders' sheet."""
        return self._spec(OdometrySpec)

    @cached_property
    def light(self) -> LightSpec | None:
        """The photocells' sheet."""
        return self._spec(LightSpec)

    @cached_property
    def infrared(self) -> InfraredSpec | None:
        """The passive infrared sensor's sheet."""
        return self._spec(InfraredSpec)

    @cached_property
    def scan(self) -> ScanSpec | None:
        """The laser scanner's sheet."""
        return self._spec(ScanSpec)

    @cached_property
    def actuator_places(self) -> dict[str, slice]:
        """Where the numbers of each own actuator stand among those of all of them, by its name."""
        places: dict[str, slice] = {}
        start = 0
        for name, spec in self.actuators.items():
            places[name] = slice(start, start + spec.width)
            start += spec.width
        return places

    def _spec(self, kind: type[S]) -> S | None:
        return next((spec for spec in self.sensors.values() if isinstance(spec, kind)), None)

    @property
    def wheels(self) -> Wheels | Twist:
        """The drive of a body with two wheels; NotFitted if it moves in another way."""
        if isinstance(self.drive, Holonomic):
            raise IncompatibleBody(f"the body {self.name} has no wheels: its drive is {self.drive.kind}")
        return self.drive

    @property
    def led_count(self) -> int:
        """How many LEDs it has."""
        return 0 if self.leds is None else self.leds.count

    @cached_property
    def led_places_m(self) -> FloatArray:
        """Where its LEDs sit: x ahead, y to the left, z above its lower side, (leds, 3)."""
        return np.empty((0, 3)) if self.leds is None else self.leds.places_m(self.radius_m)

    @property
    def max_linear_mps(self) -> float:
        """The fastest it can drive straight ahead."""
        return self.drive.max_linear_mps

    @property
    def max_angular_radps(self) -> float:
        """The fastest it can turn on the spot."""
        return self.drive.max_angular_radps

    @property
    def told(self) -> "Body":
        """The body as agents know it: without the classes of own senses and actuators, and without their keys.

        Keys may tell of the arena, and where a file lies tells of the machine that it lies on.
        """
        hidden: dict[str, Any] = {"kind": "", "params": {}}
        sensors = {n: replace(s, **hidden) if isinstance(s, CustomSensorSpec) else s for n, s in self.sensors.items()}
        actuators = {name: replace(spec, **hidden) for name, spec in self.actuators.items()}
        return replace(self, sensors=sensors, actuators=actuators)

    def as_mapping(self) -> dict[str, Any]:
        """The sheet as `body_from_mapping` reads it back."""
        return asdict(self)


def body_names() -> list[str]:
    """The bodies that come with swarmwire."""
    entries = (entry.name for entry in files("swarmwire.comms.bodies").iterdir())
    return sorted(name.removesuffix(".toml") for name in entries if name.endswith(".toml"))


@cache
def load_body(name: str) -> Body:
    """A body that comes with swarmwire, by name; BadInput if there is none. Everybody gets the same one."""
    return body_from(_shipped(name, "", "body"), where=f"{name}.toml")


def body_from(spec: Mapping[str, Any], where: str, beside: Path = HERE) -> Body:
    """The body of a data sheet; BadInput names `where` and the key of what is wrong.

    Files of the user's own senses and actuators lie in the folder `beside`.
    """
    like, rest = spec.get("like"), {key: value for key, value in spec.items() if key != "like"}
    if like is not None:
        base = _shipped(like, where, "like")
        base["name"] = Path(where).stem  # not the other's: a record could not tell the two apart
        if _kind_of(rest, _kind_of(base)) != _kind_of(base):
            base.pop("drive", None)  # of another kind: its limits have other names
        return body_from(_like(base, rest), where, beside)
    return _body(rest, where, beside)


def body_from_mapping(mapping: Mapping[str, Any], where: str) -> Body:
    """The body that `as_mapping` wrote down; BadInput names `where` and the key of what is wrong."""
    return _body(dict(mapping), where, None)


def merged(base: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """`base` with what `over` says in its place; tables that both have are merged."""
    both = {key for key in over if isinstance(over[key], Mapping) and isinstance(base.get(key), Mapping)}
    return {**base, **over, **{key: merged(base[key], over[key]) for key in both}}


def _body(rest: dict[str, Any], where: str, beside: Path | None) -> Body:
    """The body of a whole sheet, or, with nothing `beside`, of one that `as_mapping` wrote down."""
    sensors = mapping_of(where, "sensors", rest.pop("sensors", {}))
    rest["sensors"] = {name: _sensor(name, table, where, beside) for name, table in sensors.items()}
    actuators = mapping_of(where, "actuators", rest.pop("actuators", {}))
    rest["actuators"] = {name: _actuator(name, table, where, beside) for name, table in actuators.items()}
    if "drive" in rest:
        rest["drive"] = _drive(rest["drive"], where)
    if rest.get("leds") is not None:  # None: a sheet written down as a mapping
        rest["leds"] = built(Leds, rest["leds"], where, "leds")
    body: Body = built(Body, rest, where, "")
    fault = fault_of_body(body)
    if fault:
        raise BadInput(where, *fault)
    return body


def _like(base: dict[str, Any], rest: Mapping[str, Any]) -> dict[str, Any]:
    """`base` with what `rest` says; senses that do not go with it any more are not taken over."""
    both = merged(base, rest)
    own = rest.get("sensors", {})
    if isinstance(both.get("sensors"), dict):
        for name in unsupported_sensors(_kind_of(both), both.get("altitude_m", 0.0)):
            if name not in own:
                both["sensors"].pop(name, None)
    return both


def _sensor(name: str, table: object, where: str, beside: Path | None) -> SensorSpec:
    key = f"sensors.{name}"
    if name in (MOTORS, *WHEELS):
        raise BadInput(where, key, f"expected another name: {name} is a part of the drive, which the event fail names")
    if name in SENSOR_SPECS:
        return built(SENSOR_SPECS[name], table, where, key)
    if "kind" not in mapping_of(where, key, table) or not name.isidentifier():
        expected = f'expected {did_you_mean(SENSOR_SPECS, name)}, or a kind = "file.py:Class" of your own'
        raise BadInput(where, key, f"unknown sense; {expected}")
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


def _kind_of(spec: Mapping[str, Any], otherwise: object = "wheels") -> object:
    """The kind of drive that a sheet names."""
    drive: object = spec.get("drive")
    return cast("Mapping[str, object]", drive).get("kind", otherwise) if isinstance(drive, Mapping) else otherwise


def _drive(value: object, where: str) -> Drive:
    table = mapping_of(where, "drive", value)
    kind = table.get("kind", "wheels")
    if not isinstance(kind, str) or kind not in DRIVES:
        raise BadInput(where, "drive.kind", f"expected one of {', '.join(DRIVES)}; got {kind!r}")
    return built(DRIVES[kind], table, where, "drive")


def _shipped(name: object, where: str, key: str) -> dict[str, Any]:
    """The sheet of a body that comes with swarmwire; BadInput names `where` and `key` if there is none."""
    if name not in body_names():
        raise BadInput(where, key, f"expected {did_you_mean(body_names(), name)}; got {name!r}")
    return tomllib.loads(files("swarmwire.comms.bodies").joinpath(f"{name}.toml").read_text(encoding="utf-8"))
