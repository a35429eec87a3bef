"""Protocols of real robots, by their drivers and gateways; one that does not import says so."""

from abc import ABC

from swarmwire.agent.drivers.driver import GROUP as DRIVERS
from swarmwire.agent.drivers.driver import Driver, driver_names, load_driver
from swarmwire.comms.errors import BadInput
from swarmwire.comms.plugins import installed_points
from swarmwire.deploy.catalogue.docs import first_line, texts_of
from swarmwire.deploy.catalogue.entry import Entry, ParameterTable
from swarmwire.deploy.catalogue.schema_parameters import parameters_of_dataclass
from swarmwire.world.gateways.gateway import GROUP as GATEWAYS
from swarmwire.world.gateways.gateway import Gateway, gateway_kind, gateway_names


def drivers() -> list[Entry]:
    """The drivers that are installed."""
    return [_driver(name) for name in driver_names()]


def gateways() -> list[Entry]:
    """The gateways that are installed."""
    return [_gateway(name) for name in gateway_names()]


def _driver(name: str) -> Entry:
    try:
        kind = load_driver(name, "", "")
    except BadInput as fault:
        return _missing("driver", name, fault, DRIVERS)
    facts = (
        ("on a robot", f'swarmwire-agent run --driver {name}, or driver = {{ name = "{name}" }} in robot.toml'),
        ("body", f"{kind.body_name}, unless its user names another"),
    )
    return _entry("driver", name, kind, facts)


def _gateway(name: str) -> Entry:
    try:
        kind = gateway_kind(name, "")
    except BadInput as fault:
        return _missing("gateway", name, fault, GATEWAYS)
    facts = (
        ("in a run", f"swarmwire run --gateway {name}"),
        ("sensors that it tells", ", ".join(sorted(kind.sensors))),
    )
    return _entry("gateway", name, kind, facts)


def _entry(what: str, name: str, kind: type[Driver] | type[Gateway], facts: tuple[tuple[str, str], ...]) -> Entry:
    text, options = texts_of(kind, (Driver, Gateway, ABC, object)), parameters_of_dataclass(kind.options)
    tables = (ParameterTable("options", options),) if options else ()
    return Entry(what, name, first_line(text), facts, tables, text=text)


def _missing(what: str, name: str, fault: BadInput, group: str) -> Entry:
    point = installed_points(group)[name][0]
    return Entry(what, name, f"cannot be used: {fault.expected}", (("entry point", f"{point.value}, of {group}"),))
