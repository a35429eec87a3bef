"""Agents: behaviours, the field types of their messages, and the real robots they can drive or be mirrored by."""

from abc import ABC
from pathlib import Path
from typing import Any, Generic, get_args

import numpy as np

from swarmwire import agent
from swarmwire.agent import Agent, VectorAgent
from swarmwire.agent import behaviours as shipped
from swarmwire.agent.agent import AgentClass, NoAgent, load_agent
from swarmwire.agent.drivers.driver import GROUP as DRIVERS
from swarmwire.agent.drivers.driver import Driver, driver_names, load_driver
from swarmwire.agent.parameters import REQUIRED, TYPES, Parameter, Parametrized, parameters_of
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.plugins import installed_points, resolve
from swarmwire.deploy.cli.catalogue.schema import (
    CatalogueEntry,
    CatalogueParameter,
    ParameterTable,
    parameters_of_dataclass,
    unit_of,
)
from swarmwire.deploy.terminal.output import first_line, texts_of
from swarmwire.world.gateways.gateway import GROUP as GATEWAYS
from swarmwire.world.gateways.gateway import Gateway, gateway_kind, gateway_names
from swarmwire.world.scenario.schema import words_of_bounds

BASES = (Agent, VectorAgent, Parametrized, ABC, Generic, object)


def behaviours() -> list[CatalogueEntry]:
    """Return the built-in agents."""
    return [behaviour(f"{shipped.__name__}:{name}") for name in shipped.__all__]


def behaviour(spec: str) -> CatalogueEntry:
    """Return the agent of "module:Class" or "file.py:Class", relative to the working directory; BadInput if unknown."""
    try:
        kind = load_agent(resolve(spec, Path.cwd()))
    except NoAgent as error:
        raise BadInput(spec, "", str(error)) from error
    return _behaviour(kind, spec)


def _behaviour(kind: AgentClass, spec: str) -> CatalogueEntry:
    declared = parameters_of(kind)
    parameters = tuple(map(_parameter, declared.values()))
    text = texts_of(kind, BASES)
    vector = issubclass(kind, VectorAgent)
    return CatalogueEntry(
        kind="behaviour",
        name=kind.__name__,
        help=first_line(text),
        facts=(
            ("in a scenario", f'agent = "{spec}" in [robots.GROUP]'),
            ("decides for", "n robots at a time (VectorAgent)" if vector else "one robot (Agent)"),
            ("needs", ", ".join(kind.needs) or "nothing"),
        ),
        tables=(ParameterTable("parameters", parameters),) if parameters else (),
        text=text,
    )


def _parameter(parameter: Parameter) -> CatalogueParameter:
    bounds, is_required = parameter.bounds, parameter.default is REQUIRED
    each = ", or a list with one for each robot" if parameter.per_robot else ""
    return CatalogueParameter(
        parameter.name,
        bounds.help,
        bounds.unit or unit_of(parameter.name),
        None if is_required else parameter.default,
        is_required,
        words_of_bounds(TYPES[parameter.type], bounds) + each,
    )


def message_fields() -> list[CatalogueEntry]:
    """Return the types of a message's fields."""
    hints = {name: get_args(getattr(agent, name)) for name in agent.__all__}
    types: dict[str, np.dtype[Any]]
    types = {name: hint[-1] for name, hint in hints.items() if hint and isinstance(hint[-1], np.dtype)}
    return [
        CatalogueEntry(
            "field",
            name,
            _range(number_type),
            (("in a message", f"value: {name}"), ("bytes on air", str(number_type.itemsize))),
        )
        for name, number_type in types.items()
    ]


def _range(number_type: "np.dtype[Any]") -> str:
    if number_type.kind == "f":
        return f"a number, to {np.finfo(number_type).precision} digits"
    span = np.iinfo(number_type)
    return f"a whole number, {span.min} to {span.max}"


def drivers() -> list[CatalogueEntry]:
    """Return the installed drivers."""
    return [_driver(name) for name in driver_names()]


def gateways() -> list[CatalogueEntry]:
    """Return the installed gateways."""
    return [_gateway(name) for name in gateway_names()]


def _driver(name: str) -> CatalogueEntry:
    try:
        kind = load_driver(name, "", "")
    except BadInput as fault:
        return _missing("driver", name, fault, DRIVERS)
    facts = (
        ("on a robot", f'swarmwire-agent run --driver {name}, or driver = {{ name = "{name}" }} in robot.toml'),
        ("body", f"{kind.body_name}, unless its user names another"),
    )
    return _protocol("driver", name, kind, facts)


def _gateway(name: str) -> CatalogueEntry:
    try:
        kind = gateway_kind(name, "")
    except BadInput as fault:
        return _missing("gateway", name, fault, GATEWAYS)
    facts = (
        ("in a run", f"swarmwire run --gateway {name}"),
        ("sensors that it reads", ", ".join(sorted(kind.sensors)) or "none"),
    )
    return _protocol("gateway", name, kind, facts)


def _protocol(
    entry_kind: str, name: str, kind: type[Driver] | type[Gateway], facts: tuple[tuple[str, str], ...]
) -> CatalogueEntry:
    text, options = texts_of(kind, (Driver, Gateway, ABC, object)), parameters_of_dataclass(kind.options)
    tables = (ParameterTable("options", options),) if options else ()
    return CatalogueEntry(entry_kind, name, first_line(text), facts, tables, text=text)


def _missing(entry_kind: str, name: str, fault: BadInput, group: str) -> CatalogueEntry:
    point = installed_points(group)[name][0]
    return CatalogueEntry(
        entry_kind, name, f"cannot be used: {fault.expected}", (("entry point", f"{point.value}, of {group}"),)
    )
