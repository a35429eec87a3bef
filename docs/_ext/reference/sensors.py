"""The sensors that a body may have: the fields of their readings, and the keys of each in a data sheet."""

from collections.abc import Iterator
from dataclasses import fields
from functools import cached_property
from inspect import getdoc, getmembers
from typing import cast

from reference.markdown import code, sentence, table
from reference.parameters import HEAD, parameter_rows
from swarmwire.comms.sensors import SENSOR_SPECS, Sensors
from swarmwire.comms.sensors.sensor import RangedSensorSpec, SensorSpec
from swarmwire.deploy.catalogue.units import unit_of


def reading_table() -> str:
    """The fields of each sensor's readings, and the values that its class derives from them."""
    return table(
        ("need", "field", "shape", "unit", "meaning", "lost"), (row for name in SENSOR_SPECS for row in _rows(name))
    )


def _rows(name: str) -> Iterator[tuple[str, ...]]:
    need = code(name)
    for of in SENSOR_SPECS[name].example().reading_fields():
        yield need, code(of.name), of.shape, of.unit, sentence(of.meaning), f"{of.blank:g}"
        need = " "
    for of, value in getmembers(getattr(Sensors, name).many):
        if isinstance(value, property | cached_property):
            yield need, code(of), "", unit_of(of), sentence(getdoc(cast("object", value)) or ""), ""


def sensor_tables() -> str:
    """The keys that all sensors share; then every sensor, its description, and its own keys in a data sheet."""
    shared = [code(of.name) for of in fields(RangedSensorSpec)]
    parts = ["Keys of every sensor:\n", table(HEAD, parameter_rows(SensorSpec))]
    parts += [
        "And of every sensor with a range:\n",
        table(HEAD, parameter_rows(RangedSensorSpec)[len(fields(SensorSpec)) :]),
    ]
    for name, kind in SENSOR_SPECS.items():
        rows = [row for row in parameter_rows(kind) if row[0] not in shared]
        ranged = " It has a range." if issubclass(kind, RangedSensorSpec) else ""
        parts.append(f"{code(f'[sensors.{name}]')}: {sentence(getdoc(kind) or '')}{ranged}\n")
        parts.append(table(HEAD, rows) if rows else "It has no keys of its own.\n")
    return "\n".join(parts)
