"""Specs of custom sensors and actuators: the tables in a body file, and the facts that agents get.

A body file names the class and its parameters; the fields of a sensor and the width of an actuator are known once the
class is loaded. The `read_…` functions read specs that `asdict` has converted to tables.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, cast

from swarmwire.comms.base.config import check_plain, parameter
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.plugins import resolve
from swarmwire.comms.robot.bodies.tables import mapping_of, parse_table
from swarmwire.comms.robot.sensors.sensor import Field, RangedSensorSpec

MAX_WIDTH = 10_000  # values of a field or an actuator per robot


@dataclass(frozen=True)
class CustomSensorSpec(RangedSensorSpec):
    """A sensor with a custom class; other keys of its table are parameters of that class. Readings: its fields."""

    kind: str = parameter(
        help='"file.py:Class" beside the body file, "package.module:Class", or the name of an entry point'
    )
    params: dict[str, Any] = parameter(help="keys of the class, as in the body file; agents do not get them")
    fields: dict[str, int] = parameter(help="fields of the class and their widths; 0: a number per robot")

    def reading_fields(self) -> tuple[Field, ...]:
        """Return the names and widths of the fields, without the noise and the ranges of the class."""
        return tuple(Field(name, width) for name, width in self.fields.items())


def custom_sensor_spec(value: object, where: str, key: str, folder: Path) -> CustomSensorSpec:
    """Make the spec of a table in a body file, which has a `kind`; its fields stay empty until the class is loaded."""
    table = mapping_of(where, key, value)
    shared = {name: table.pop(name) for name in [field.name for field in fields(RangedSensorSpec)] if name in table}
    kind = kind_of(table, where, key, folder)
    check_plain(table, where, key)
    return parse_table(CustomSensorSpec, {**shared, "kind": kind, "params": table, "fields": {}}, where, key)


def kind_of(table: dict[str, Any], where: str, key: str, folder: Path) -> str:
    """Remove the `kind` of a table and return it, with the path of a file made absolute; BadInput if it is no text."""
    kind = table.pop("kind")
    if not isinstance(kind, str) or not kind:
        expected = 'expected "file.py:Class", "package.module:Class" or the name of an entry point'
        raise BadInput(where, f"{key}.kind", f"{expected}; got {kind!r}")
    return resolve(kind, folder)


def read_custom_sensor_spec(value: object, where: str, key: str) -> CustomSensorSpec:
    """Read the table that `asdict` made of a spec, with the keys `params` and `fields`."""
    table = mapping_of(where, key, value)
    mapping_of(where, f"{key}.params", table.get("params"))
    widths = mapping_of(where, f"{key}.fields", table.get("fields"))
    values = cast("Mapping[str, object]", widths).values()
    if not all(type(width) is int and 0 <= width <= MAX_WIDTH for width in values):
        raise BadInput(where, f"{key}.fields", f"expected whole numbers from 0 to {MAX_WIDTH}, got {widths!r}")
    return parse_table(CustomSensorSpec, table, where, key)


@dataclass(frozen=True)
class CustomActuatorSpec:
    """An actuator with a custom class; agents set it by `robot.actuate(name, …)`."""

    kind: str = parameter(
        help='"file.py:Class" beside the body file, "package.module:Class", or the name of an entry point'
    )
    params: dict[str, Any] = parameter(help="keys of the class, as in the body file; agents do not get them")
    width: int = parameter(0, help="number of values of a command; 0: unknown until the class is loaded")


def custom_actuator_spec(value: object, where: str, key: str, folder: Path) -> CustomActuatorSpec:
    """Make the spec of a table in a body file, which has a `kind`; its width stays 0 until the class is loaded."""
    table = mapping_of(where, key, value)
    if "kind" not in table:
        raise BadInput(where, f"{key}.kind", "is missing")
    kind = kind_of(table, where, key, folder)
    check_plain(table, where, key)
    return parse_table(CustomActuatorSpec, {"kind": kind, "params": table}, where, key)


def read_custom_actuator_spec(value: object, where: str, key: str) -> CustomActuatorSpec:
    """Read the table that `asdict` made of a spec, with the keys `params` and `width`."""
    table = mapping_of(where, key, value)
    mapping_of(where, f"{key}.params", table.get("params"))
    width = table.get("width")
    if type(width) is not int or not 0 <= width <= MAX_WIDTH:
        raise BadInput(where, f"{key}.width", f"expected a whole number from 0 to {MAX_WIDTH}, got {width!r}")
    return parse_table(CustomActuatorSpec, table, where, key)
