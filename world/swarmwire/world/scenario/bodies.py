"""The body of each group: a bundled one, or a custom data sheet next to the scenario."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

from swarmwire.comms.base.config import folder_of, read_toml
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.observe.truth import Static
from swarmwire.comms.robot.bodies.body import Body, body_from, load_body, merged
from swarmwire.comms.robot.bodies.custom import CustomActuatorSpec, CustomSensorSpec
from swarmwire.world.custom.actuators import fitted_actuator
from swarmwire.world.scenario.scenario import RobotsTable, Scenario
from swarmwire.world.sensors.loading import fitted_sensor


def bodies_of(scenario: Scenario, where: str) -> dict[str, Body]:
    """Return the body of each group by name; BadInput names the scenario or the custom data sheet."""
    sheets: dict[str, Body] = {}
    bodies: dict[str, Body] = {}
    for group, table in scenario.robots.items():
        if table.body not in sheets:
            sheets[table.body] = _body(table.body, where, f"robots.{group}.body")
        bodies[group] = _with_overrides(sheets[table.body], group, table, where)
    return bodies


def sheet_path(body: str, where: str) -> Path | None:
    """Return the path of the custom data sheet that a scenario names as `body`; None for a bundled body."""
    return (folder_of(where) / body).resolve() if body.endswith(".toml") else None


def custom_code(static: Static) -> tuple[str, ...]:
    """Return the classes of the bodies' custom parts: "package.module:Class" or "/path/file.py:Class"."""
    return custom_code_of(group.body for group in static.groups)


def custom_code_of(bodies: Iterable[Body]) -> tuple[str, ...]:
    """Return the classes of these bodies' custom sensors and actuators, in the same form."""
    specs = [spec for body in bodies for spec in (*body.sensors.values(), *body.actuators.values())]
    return tuple(dict.fromkeys(spec.kind for spec in specs if isinstance(spec, CustomSensorSpec | CustomActuatorSpec)))


def _body(name: str, where: str, key: str) -> Body:
    if "\0" in name:
        raise BadInput(where, key, "expected the name of a body or of a file, got a text with a zero byte")
    path = sheet_path(name, where)
    if path is None:
        try:
            return load_body(name)
        except BadInput as error:
            raise BadInput(where, key, error.expected) from None
    return read_body(path, where, key)


def _with_overrides(body: Body, group: str, table: RobotsTable, where: str) -> Body:
    """Apply the scenario's `body_overrides` to the body; the group in its name makes it unique."""
    if not table.body_overrides:
        return body
    key = f"robots.{group}.body_overrides"
    path = sheet_path(table.body, where)
    base = {"like": table.body} if path is None else read_toml(path)
    spec = merged({**base, "name": f"{body.name} of {group}"}, table.body_overrides)
    try:
        changed = body_from(spec, where) if path is None else _fitted(spec, path)
    except BadInput as error:
        raise BadInput(where, ".".join(filter(None, (key, error.key))), error.expected) from None
    if custom_code_of([changed]) != custom_code_of([body]):
        raise BadInput(where, key, "expected no custom classes; put them in a data sheet and name its file as `body`")
    return changed


def read_body(path: Path, where: str, key: str) -> Body:
    """Read a body from a custom data sheet, and load the classes of its custom sensors and actuators.

    BadInput names the sheet; if it cannot be read, `where` and `key`.
    """
    spec = read_toml(path, (where, key))
    if "robots" in spec:
        raise BadInput(str(path), "", "expected a body's data sheet, got a scenario; use swarmwire check or draw")
    return _fitted(spec, path)


def fitted(body: Body, where: str) -> Body:
    """Return the body with the fields and widths of its custom parts' classes; BadInput for a fault."""
    sensors = {name: fitted_sensor(spec, where, f"sensors.{name}") for name, spec in body.sensors.items()}
    actuators = {name: fitted_actuator(spec, where, f"actuators.{name}") for name, spec in body.actuators.items()}
    return replace(body, sensors=sensors, actuators=actuators)


def _fitted(spec: dict[str, Any], path: Path) -> Body:
    return fitted(body_from(spec, str(path), path.parent), str(path))
