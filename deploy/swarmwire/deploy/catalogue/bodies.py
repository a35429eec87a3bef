"""Bodies: kinds of robot, from their data sheets."""

from collections.abc import Sequence
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

from swarmwire.comms.bodies.body import Body, body_names, load_body
from swarmwire.comms.bodies.custom import CustomSensorSpec
from swarmwire.comms.bodies.drives import Leds
from swarmwire.comms.config import bounds_of
from swarmwire.comms.sensors.sensor import RangedSensorSpec, SensorSpec
from swarmwire.deploy.catalogue.entry import Entry, Parameter, ParameterTable
from swarmwire.deploy.catalogue.schema_parameters import parameters_of_dataclass
from swarmwire.deploy.catalogue.sensors import reading_table
from swarmwire.deploy.catalogue.units import unit_of
from swarmwire.world.custom.actuators import custom_actuator
from swarmwire.world.scenario.bodies import read_body
from swarmwire.world.sensors.loading import custom_sensor

GEOMETRY = ("radius_m", "height_m", "mass_kg", "altitude_m", "contacts")


def bodies() -> list[Entry]:
    """The bodies that come with swarmwire."""
    return [_body(load_body(name), name) for name in body_names()]


def body_of(path: Path) -> Entry:
    """The body of a sheet of the user's own; BadInput names it and what is wrong with it."""
    return _body(read_body(path, str(path), ""), str(path))


def _body(body: Body, named: str) -> Entry:
    sheet = asdict(body)
    geometry = [key for key in parameters_of_dataclass(Body) if key.name in GEOMETRY]
    leds = [] if body.leds is None else [_sheet("leds", Leds, sheet["leds"])]
    sensors = [table for name, of in body.sensors.items() for table in _sensor(name, of)]
    actuators = [_own(f"actuator: {name}", of.kind, custom_actuator(of)) for name, of in body.actuators.items()]
    return Entry(
        kind="body",
        name=body.name,
        help=f"radius {body.radius_m:.3g} m, at most {body.max_linear_mps:.3g} m/s; sensors: {', '.join(body.sensors)}",
        facts=(
            ("in a scenario", f'body = "{named}" in [robots.GROUP]'),
            ("fastest ahead", f"{body.max_linear_mps:.4g} m/s"),
            ("fastest turn", f"{body.max_angular_radps:.4g} rad/s"),
            ("source", body.source),
        ),
        tables=(
            ParameterTable("geometry", tuple(_with_values(geometry, sheet)), "value"),
            _sheet("drive", type(body.drive), sheet["drive"]),
            *leds,
            *sensors,
            *actuators,
        ),
    )


def _sheet(title: str, kind: type[Any], values: dict[str, Any]) -> ParameterTable:
    return ParameterTable(title, tuple(_with_values(parameters_of_dataclass(kind), values)), "value")


def _sensor(name: str, sheet: SensorSpec) -> tuple[ParameterTable, ParameterTable]:
    """The keys of a sensor, and the fields of its readings."""
    title, reading = f"sensor: {name}", f"reading: {name}"
    if not isinstance(sheet, CustomSensorSpec):
        return _sheet(title, type(sheet), asdict(sheet)), reading_table(sheet.reading_fields(), reading)
    shared, own = _with_values(parameters_of_dataclass(RangedSensorSpec), asdict(sheet)), custom_sensor(sheet)
    return _own(title, sheet.kind, own, shared), reading_table(own.fields, reading)


def _own(title: str, kind: str, made: Any, shared: Sequence[Parameter] = ()) -> ParameterTable:
    """What `kind` leads to, the keys shared with others, and those of the class of the user's own."""
    told = next(bounds_of(of).help for of in fields(CustomSensorSpec) if of.name == "kind")
    limits = {of.name: bounds_of(of) for of in fields(made)}
    keys = [Parameter(name, of.help, of.unit or unit_of(name), getattr(made, name)) for name, of in limits.items()]
    return ParameterTable(title, (Parameter("kind", told, value=kind), *shared, *keys), "value")


def _with_values(parameters: "list[Parameter] | tuple[Parameter, ...]", values: dict[str, Any]) -> list[Parameter]:
    """The parameters with a sheet's figures as values; those of nested tables by their path."""
    return [replace(key, value=_at(values, key.name), required=False) for key in parameters]


def _at(values: dict[str, Any], path: str) -> Any:
    value: Any = values
    for name in path.split("."):
        value = value[name]
    return None if isinstance(value, dict) else value
