"""An event that is given while a run goes on: read and checked as those of its scenario are, with faults as plain."""

from collections.abc import Mapping
from copy import deepcopy
from functools import cache
from typing import Annotated, Any

from pydantic import ValidationError

from swarmwire.comms.bodies.body import Body
from swarmwire.comms.errors import BadInput
from swarmwire.comms.events.event import Event
from swarmwire.comms.events.registry import ACTIONS
from swarmwire.world.scenario.checks import check_event
from swarmwire.world.scenario.faults import fault
from swarmwire.world.scenario.scenario import Scenario
from swarmwire.world.scenario.schema import OneOf
from swarmwire.world.scenario.schema_words import Node
from swarmwire.world.scenario.tables import Table

KEY = "event"
AT_S = "at_s"


class GivenTable(Table):
    """What somebody gives: one event."""

    event: Annotated[Event, OneOf("do", ACTIONS)]


def event_of(table: Mapping[str, Any], scenario: Scenario, bodies: Mapping[str, Body]) -> Event:
    """The event of a table as in [[events]] of a scenario, but without at_s: it says 0, until it takes effect.

    `bodies` are the groups', by group. BadInput names the key within the table and what was expected.
    """
    if AT_S in table:
        raise BadInput("", AT_S, "expected no time: an event that is given takes effect at the start of the next tick")
    given = {KEY: {**deepcopy(dict(table)), AT_S: 0.0}}
    try:
        event = GivenTable.model_validate(given).event
        check_event(scenario, bodies, event, KEY, "")
    except ValidationError as error:
        raise _as_given(fault(error, _schema(), "")) from None
    except BadInput as error:
        raise _as_given(error) from None
    return event


def _as_given(error: BadInput) -> BadInput:
    return BadInput("", error.key.removeprefix(KEY).removeprefix("."), error.expected)


@cache
def _schema() -> Node:
    return GivenTable.model_json_schema()
