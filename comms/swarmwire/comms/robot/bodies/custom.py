"""Specs of custom sensors and actuators: their tables in a body file, and the facts that agents get of them.

A body file names the class and its parameters; the fields of a sensor and the width of an actuator are known once the
class is loaded. The `read_…` functions read specs that `asdict` wrote down.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, cast

from swarmwire.comms.base.config import check_plain, parameter
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.plugins import resolve
from swarmwire.comms.robot.bodies.tables import built, mapping_of
from swarmwire.comms.robot.sensors.sensor import Field, RangedSensorSpec

MAX_WIDTH = 10_000  # numbers in a field, or of an actuator, for one robot


@dataclass(frozen=True)
class CustomSensorSpec(RangedSensorSpec):
    """A sensor with a custom class; other keys of its table are parameters of that class. Readings: its fields."""

    kind: str = parameter(
        help='"file.py:Class" beside the body file, "package.module:Class", or the name of an entry point'
    )
    params: dict[str, Any] = parameter(help="keys of the class, as in the body file; agents do not get them")
    fields: dict[str, int] = parameter(help="the class's fields and their widths; 0: a number per robot")

    def reading_fields(self) -> tuple[Field, ...]:
        """As `SensorSpec.reading_fields`: names and widths, without the noise and the ranges of the class."""
        return tuple(Field(name, width) for name, width in self.fields.items())


def custom_sensor_spec(value: object, where: str, key: str, beside: Path) -> CustomSensorSpec:
    """The spec of a table in a body file, which has a `kind`; its fields stay empty until the class is loaded."""
    table = mapping_of(where, key, value)
    shared = {name: table.pop(name) for name in [field.name for field in fields(RangedSensorSpec)] if name in table}
    kind = kind_of(table, where, key, beside)
    check_plain(table, where, key)
    return built(CustomSensorSpec, {**shared, "kind": kind, "params": table, "fields": {}}, where, key)


def kind_of(table: dict[str, Any], where: str, key: str, beside: Path) -> str:
    """Remove the `kind` of a table and return it, with the path of a file made absolute; BadInput if it is no text."""
    kind = table.pop("kind")
    if not isinstance(kind, str) or not kind:
        expected = 'expected "file.py:Class", "package.module:Class" or the name of an entry point'
        raise BadInput(where, f"{key}.kind", f"{expected}; got {kind!r}")
    return resolve(kind, beside)


def read_custom_sensor_spec(value: object, where: str, key: str) -> CustomSensorSpec:
    """The spec that `asdict` made into this table, with `params` and `fields` apart."""
    table = mapping_of(where, key, value)
    mapping_of(where, f"{key}.params", table.get("params"))
    widths = mapping_of(where, f"{key}.fields", table.get("fields"))
    numbers = cast("Mapping[str, object]", widths).values()
    if not all(type(width) is int and 0 <= width <= MAX_WIDTH for width in numbers):
        raise BadInput(where, f"{key}.fields", f"expected whole numbers from 0 to {MAX_WIDTH}, got {widths!r}")
    return built(CustomSensorSpec, table, where, key)


@dataclass(frozen=True)
class CustomActuatorSpec:
    """An actuator with a custom class; agents set it by `robot.actuate(name, …)`."""

    kind: str = parameter(
        help='"file.py:Class" beside the body file, "package.module:Class", or the name of an entry point'
    )
    params: dict[str, Any] = parameter(help="keys of the class, as in the body file; agents do not get them")
    width: int = parameter(0, help="how many numbers it takes; 0: not known yet")


def custom_actuator_spec(value: object, where: str, key: str, beside: Path) -> CustomActuatorSpec:
    """The spec of a table in a body file, which has a `kind`; its width stays 0 until the class is loaded."""
    table = mapping_of(where, key, value)
    if "kind" not in table:
        raise BadInput(where, f"{key}.kind", "is missing")
    kind = kind_of(table, where, key, beside)
    check_plain(table, where, key)
    return built(CustomActuatorSpec, {"kind": kind, "params": table}, where, key)


def read_custom_actuator_spec(value: object, where: str, key: str) -> CustomActuatorSpec:
    """The spec that `asdict` made into this table, with `params` and `width` apart."""
    table = mapping_of(where, key, value)
    mapping_of(where, f"{key}.params", table.get("params"))
    width = table.get("width")
    if type(width) is not int or not 0 <= width <= MAX_WIDTH:
        raise BadInput(where, f"{key}.width", f"expected a whole number from 0 to {MAX_WIDTH}, got {width!r}")
    return built(CustomActuatorSpec, table, where, key)
