"""The sensors that a body may have, with the keys of each in a data sheet."""

from dataclasses import fields
from inspect import getdoc

from reference.markdown import code, sentence, table
from reference.parameters import HEAD, parameter_rows
from swarmwire.comms.bodies.sensors import SENSOR_SPECS
from swarmwire.comms.bodies.spec import RangedSensorSpec, SensorSpec


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
