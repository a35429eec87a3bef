"""Bodies: kinds of robot, from their data sheets."""

from dataclasses import asdict, replace
from typing import Any

from swarmwire.comms.body import Body, body_names, load_body
from swarmwire.comms.leds import Leds
from swarmwire.comms.sheets import SHEETS
from swarmwire.deploy.catalogue.entry import Entry, Parameter, ParameterTable
from swarmwire.deploy.catalogue.schema_parameters import parameters_of_dataclass

GEOMETRY = ("radius_m", "height_m", "mass_kg", "altitude_m", "contacts")


def bodies() -> list[Entry]:
    """The bodies that come with swarmwire."""
    return [_body(load_body(name)) for name in body_names()]


def _body(body: Body) -> Entry:
    sheet = asdict(body)
    geometry = [key for key in parameters_of_dataclass(Body) if key.name in GEOMETRY]
    leds = [] if body.leds is None else [_sheet("leds", Leds, sheet["leds"])]
    senses = [_sheet(f"sense: {name}", SHEETS[name], sheet["senses"][name]) for name in body.senses]
    return Entry(
        kind="body",
        name=body.name,
        help=f"radius {body.radius_m:.3g} m, at most {body.max_linear_mps:.3g} m/s; senses: {', '.join(body.senses)}",
        facts=(
            ("in a scenario", f'body = "{body.name}" in [robots.GROUP]'),
            ("fastest ahead", f"{body.max_linear_mps:.4g} m/s"),
            ("fastest turn", f"{body.max_angular_radps:.4g} rad/s"),
            ("source", body.source),
        ),
        tables=(
            ParameterTable("geometry", tuple(_with_values(geometry, sheet)), "value"),
            _sheet("drive", type(body.drive), sheet["drive"]),
            *leds,
            *senses,
        ),
    )


def _sheet(title: str, kind: type[Any], values: dict[str, Any]) -> ParameterTable:
    return ParameterTable(title, tuple(_with_values(parameters_of_dataclass(kind), values)), "value")


def _with_values(parameters: "list[Parameter] | tuple[Parameter, ...]", values: dict[str, Any]) -> list[Parameter]:
    """The parameters with a sheet's figures as values; those of nested tables by their path."""
    return [replace(key, value=_at(values, key.name), required=False) for key in parameters]


def _at(values: dict[str, Any], path: str) -> Any:
    value: Any = values
    for name in path.split("."):
        value = value[name]
    return None if isinstance(value, dict) else value
