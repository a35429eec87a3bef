"""Senses: what an agent's `needs` may name, of its body, of packets that it hears and of those that it sent."""

from collections.abc import Iterable, Iterator
from dataclasses import fields
from typing import Any, get_args, get_type_hints

from swarmwire.agent import Packet, Robot
from swarmwire.agent.robot import RadioPort
from swarmwire.agent.step_context import TX_STATUS
from swarmwire.comms.bodies.body import body_names, load_body
from swarmwire.comms.packets import TxResult
from swarmwire.comms.radio.config.impairments import Measures
from swarmwire.comms.sensors import SENSOR_SPECS
from swarmwire.comms.sensors.sensor import Field
from swarmwire.deploy.catalogue.docs import first_line, paragraphs
from swarmwire.deploy.catalogue.entry import Entry, Parameter, ParameterTable
from swarmwire.deploy.catalogue.schema_parameters import parameters_of_dataclass


def sensors() -> list[Entry]:
    """Those of bodies, then those of packets."""
    return [*_of_bodies(), *_of_packets(), _of_tx_status()]


def _of_bodies() -> Iterator[Entry]:
    bodies = [load_body(name) for name in body_names()]
    for name, sheet in SENSOR_SPECS.items():
        have = ", ".join(body.name for body in bodies if name in body.sensors)
        told = first_line(getattr(Robot, name).__doc__)
        where = "bodies", have or "none that comes with swarmwire"
        yield _sensor(name, sheet, f"robot.{name}: {told}", where, reading_table(sheet.example().reading_fields()))


def _of_packets() -> Iterator[Entry]:
    hints = get_type_hints(Measures)
    for of in fields(Measures):
        kind = next(arg for arg in get_args(hints[of.name]) if arg is not type(None))
        (column,) = Measures(**{of.name: kind()}).columns
        told = first_line(getattr(Packet, column).__doc__)
        yield _sensor(f"radio.{of.name}", kind, f"packet.{column}: {told}", ("given by", f"[radio] measures.{of.name}"))


def _of_tx_status() -> Entry:
    results = tuple((result.name, result.meaning) for result in TxResult)
    facts = (
        ("in an agent", f'needs = ("{TX_STATUS}", …)'),
        ("read as", f"robot.radio.tx_status: {first_line(RadioPort.tx_status.__doc__)}"),
        ("given by", "[radio.access] with method csma-802154 or dcf, acknowledged"),
    )
    told = "The sender learns what became of a packet to one robot, as far as its own radio knows."
    return Entry(kind="sensor", name=TX_STATUS, help=told, facts=(*facts, *results))


def reading_table(fields: Iterable[Field], title: str = "reading") -> ParameterTable:
    """The fields of a reading, each with its unit, the value of a lost reading, its meaning and its shape."""
    rows = (Parameter(of.name, of.meaning, of.unit, of.blank, expected=of.shape) for of in fields)
    return ParameterTable(title, tuple(rows), "lost")


def _sensor(name: str, sheet: type[Any], read: str, where: tuple[str, str], *tables: ParameterTable) -> Entry:
    parameters = parameters_of_dataclass(sheet)
    return Entry(
        kind="sensor",
        name=name,
        help=first_line(sheet.__doc__),
        facts=(("in an agent", f'needs = ("{name}", …)'), ("read as", read), where),
        tables=(*tables, *((ParameterTable("data sheet", parameters),) if parameters else ())),
        text=paragraphs(sheet.__doc__),
    )
