"""Events: what may happen to robots and radios on the way, by the name that `do` gives."""

from dataclasses import fields
from typing import Any

from swarmwire.comms.config import bounds_of
from swarmwire.comms.events.event import Event
from swarmwire.comms.events.registry import ACTIONS
from swarmwire.deploy.catalogue.docs import paragraphs
from swarmwire.deploy.catalogue.entry import Entry, ParameterTable
from swarmwire.deploy.catalogue.schema_parameters import parameters_of_dataclass


def events() -> list[Entry]:
    """The actions of the registry."""
    return [_event(kind) for kind in ACTIONS]


def _event(kind: type[Event]) -> Entry:
    do: Any = next(of for of in fields(kind) if of.name == "do")
    return Entry(
        kind="event",
        name=do.default,
        help=bounds_of(do).help,
        facts=(
            ("in a scenario", f'do = "{do.default}" in [[events]]'),
            ("needs a radio", "with signals" if kind.needs_signals else "yes" if kind.needs_radio else "no"),
        ),
        tables=(ParameterTable("keys", parameters_of_dataclass(kind)),),
        text=paragraphs(kind.__doc__),
    )
