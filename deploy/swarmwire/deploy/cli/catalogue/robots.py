"""Entries of bodies, and of drives, keys and sensors of their data sheets."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, fields, replace
from functools import cached_property
from inspect import getmembers
from pathlib import Path
from typing import Any, get_args, get_type_hints

from swarmwire.agent import Packet, Robot
from swarmwire.agent.robot import RadioPort
from swarmwire.agent.step_context import TX_STATUS
from swarmwire.comms.base.config import bounds_of
from swarmwire.comms.radio.config.impairments import Measures
from swarmwire.comms.robot.bodies.body import Body, body_names, load_body
from swarmwire.comms.robot.bodies.custom import CustomSensorSpec
from swarmwire.comms.robot.bodies.drives import DRIVES, Leds
from swarmwire.comms.robot.bodies.ros2_names import DEFAULT_NAMES, Ros2Names
from swarmwire.comms.robot.packets import TxResult
from swarmwire.comms.robot.sensors import SENSOR_SPECS, Sensors
from swarmwire.comms.robot.sensors.sensor import Field, RangedSensorSpec, SensorSpec
from swarmwire.deploy.cli.catalogue.schema import (
    CatalogueEntry,
    CatalogueParameter,
    ParameterTable,
    parameters_of_dataclass,
    unit_of,
)
from swarmwire.deploy.terminal.output import first_line, flowing
from swarmwire.world.custom.actuators import custom_actuator
from swarmwire.world.scenario.bodies import read_body
from swarmwire.world.sensors.loading import custom_sensor

GEOMETRY = ("radius_m", "height_m", "mass_kg", "altitude_m", "contacts")


def bodies() -> list[CatalogueEntry]:
    """Return the built-in bodies."""
    return [_body(load_body(name), name) for name in body_names()]


def body_of(path: Path) -> CatalogueEntry:
    """Return the body of a data sheet of the user; BadInput for an invalid sheet."""
    return _body(read_body(path, str(path), ""), str(path))


def _body(body: Body, reference: str) -> CatalogueEntry:
    sheet = asdict(body)
    geometry = [key for key in parameters_of_dataclass(Body) if key.name in GEOMETRY]
    leds = [] if body.leds is None else [_sheet("leds", Leds, sheet["leds"])]
    ros2 = [] if body.ros2 == DEFAULT_NAMES else [_sheet("ros2", Ros2Names, sheet["ros2"])]
    sensors = [table for name, spec in body.sensors.items() for table in _sensor_tables(name, spec)]
    actuators = [
        _custom_table(f"actuator: {name}", spec.kind, custom_actuator(spec)) for name, spec in body.actuators.items()
    ]
    return CatalogueEntry(
        kind="body",
        name=body.name,
        help=f"radius {body.radius_m:.3g} m, at most {body.max_linear_mps:.3g} m/s; sensors: {', '.join(body.sensors)}",
        facts=(
            ("in a scenario", f'body = "{reference}" in [robots.GROUP]'),
            ("fastest ahead", f"{body.max_linear_mps:.4g} m/s"),
            ("fastest turn", f"{body.max_angular_radps:.4g} rad/s"),
            ("source", body.source),
        ),
        tables=(
            ParameterTable("geometry", tuple(_with_values(geometry, sheet)), "value"),
            _sheet("drive", type(body.drive), sheet["drive"]),
            *leds,
            *ros2,
            *sensors,
            *actuators,
        ),
    )


def _sheet(title: str, kind: type[Any], values: dict[str, Any]) -> ParameterTable:
    return ParameterTable(title, tuple(_with_values(parameters_of_dataclass(kind), values)), "value")


def _sensor_tables(name: str, sheet: SensorSpec) -> tuple[ParameterTable, ParameterTable]:
    """Return the keys of a body's sensor, and the fields of its readings."""
    title, reading = f"sensor: {name}", f"reading: {name}"
    if not isinstance(sheet, CustomSensorSpec):
        return _sheet(title, type(sheet), asdict(sheet)), reading_table(sheet.reading_fields(), reading)
    shared, custom = _with_values(parameters_of_dataclass(RangedSensorSpec), asdict(sheet)), custom_sensor(sheet)
    return _custom_table(title, sheet.kind, custom, shared), reading_table(custom.fields, reading)


def _custom_table(title: str, kind: str, device: Any, shared: Sequence[CatalogueParameter] = ()) -> ParameterTable:
    """Return `kind`, the keys that devices share, and the keys of the class of a custom device."""
    kind_help = next(bounds_of(key).help for key in fields(CustomSensorSpec) if key.name == "kind")
    bounds = {key.name: bounds_of(key) for key in fields(device)}
    keys = [
        CatalogueParameter(name, bound.help, bound.unit or unit_of(name), getattr(device, name))
        for name, bound in bounds.items()
    ]
    return ParameterTable(title, (CatalogueParameter("kind", kind_help, value=kind), *shared, *keys), "value")


def _with_values(
    parameters: "list[CatalogueParameter] | tuple[CatalogueParameter, ...]", values: dict[str, Any]
) -> list[CatalogueParameter]:
    """Return the parameters with the values of a sheet, of nested tables by path."""
    return [replace(key, value=_value_at(values, key.name), required=False) for key in parameters]


def _value_at(values: dict[str, Any], path: str) -> Any:
    value: Any = values
    for name in path.split("."):
        value = value[name]
    return None if isinstance(value, dict) else value


def drives() -> list[CatalogueEntry]:
    """Return all kinds of drive, with the keys of their tables."""
    return [
        CatalogueEntry(
            kind="drive",
            name=name,
            help=first_line(kind.__doc__),
            facts=(("in a body's sheet", f'kind = "{name}" in [drive]'),),
            tables=(ParameterTable("keys", parameters_of_dataclass(kind)),),
            text=flowing(kind.__doc__),
        )
        for name, kind in DRIVES.items()
    ]


SHEET_TABLES: dict[str, type[Any]] = {"leds": Leds, "ros2": Ros2Names}
TABLES = ("drive", "leds", "ros2", "sensors", "actuators")  # tables with their own entries


def sheet_keys() -> list[CatalogueEntry]:
    """Return the keys of every sheet, then the tables of LEDs and of names in ROS 2."""
    keys = [key for key in parameters_of_dataclass(Body) if key.name.partition(".")[0] not in TABLES]
    keys.insert(
        0,
        CatalogueParameter("like", "body that this one starts from", expected="a body's name, or the path of a sheet"),
    )
    top_level = [
        CatalogueEntry(
            kind="body-key",
            name=key.name,
            help=key.help,
            facts=(("in a body's sheet", f"{key.name}, before the first table"),),
            tables=(ParameterTable("key", (key,)),),
        )
        for key in keys
    ]
    tables = [
        CatalogueEntry(
            kind="body-key",
            name=name,
            help=first_line(kind.__doc__),
            facts=(("in a body's sheet", f"the table [{name}]"),),
            tables=(ParameterTable(f"keys of {name}", parameters_of_dataclass(kind)),),
            text=flowing(kind.__doc__),
        )
        for name, kind in SHEET_TABLES.items()
    ]
    return [*top_level, *tables]


def sensors() -> list[CatalogueEntry]:
    """Return the sensors of bodies, then the measurements of packets."""
    return [*_body_sensors(), *_packet_sensors(), _tx_status()]


def _body_sensors() -> Iterator[CatalogueEntry]:
    bodies = [load_body(name) for name in body_names()]
    for name, sheet in SENSOR_SPECS.items():
        have = ", ".join(body.name for body in bodies if name in body.sensors)
        meaning = first_line(getattr(Robot, name).__doc__)
        source = "bodies", have or "none that comes with swarmwire"
        yield _sensor(
            name,
            sheet,
            f"robot.{name}: {meaning}",
            source,
            reading_table(sheet.example().reading_fields(), kind=getattr(Sensors, name).make_readings),
        )


def _packet_sensors() -> Iterator[CatalogueEntry]:
    hints = get_type_hints(Measures)
    for name in (measure.name for measure in fields(Measures)):
        kind = next(arg for arg in get_args(hints[name]) if arg is not type(None))
        (column,) = Measures(**{name: kind()}).columns
        meaning = first_line(getattr(Packet, column).__doc__)
        yield _sensor(f"radio.{name}", kind, f"packet.{column}: {meaning}", ("given by", f"[radio] measures.{name}"))


def _tx_status() -> CatalogueEntry:
    results = tuple((result.name, result.meaning) for result in TxResult)
    facts = (
        ("in an agent", f'needs = ("{TX_STATUS}", …)'),
        ("read as", f"robot.radio.tx_status: {first_line(RadioPort.tx_status.__doc__)}"),
        ("given by", "[radio.access] with method csma-802154 or dcf, acknowledged"),
    )
    text = "The sender gets a transmit status for each unicast packet, as far as its own radio knows."
    return CatalogueEntry(kind="sensor", name=TX_STATUS, help=text, facts=(*facts, *results))


def reading_table(fields: Iterable[Field], title: str = "reading", kind: type[Any] | None = None) -> ParameterTable:
    """Return the fields of a reading with unit, value of a lost reading, meaning and shape, and derived properties."""
    rows = [
        CatalogueParameter(field.name, field.meaning, field.unit, field.blank, expected=field.shape) for field in fields
    ]
    for name, member in getmembers(kind):
        if isinstance(member, property | cached_property):
            rows.append(CatalogueParameter(name, first_line(member.__doc__), unit_of(name)))
    return ParameterTable(title, tuple(rows), "lost")


def _sensor(name: str, sheet: type[Any], read: str, source: tuple[str, str], *tables: ParameterTable) -> CatalogueEntry:
    parameters = parameters_of_dataclass(sheet)
    return CatalogueEntry(
        kind="sensor",
        name=name,
        help=first_line(sheet.__doc__),
        facts=(("in an agent", f'needs = ("{name}", …)'), ("read as", read), source),
        tables=(*tables, *((ParameterTable("data sheet", parameters),) if parameters else ())),
        text=flowing(sheet.__doc__),
    )
