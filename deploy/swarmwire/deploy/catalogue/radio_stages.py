"""Stages of the radio: what a packet passes on its way to a receiver, in order."""

from swarmwire.comms.radio.stages.chain import ORDER
from swarmwire.comms.radio.stages.loss import LossModel
from swarmwire.comms.radio.stages.stage import Stage
from swarmwire.deploy.catalogue.docs import first_line, paragraphs
from swarmwire.deploy.catalogue.entry import Entry, ParameterTable
from swarmwire.deploy.catalogue.scenario_keys import all_keys


def radio_stages() -> list[Entry]:
    """The stages of the chain, in order."""
    return [_stage(kind, place) for place, kind in enumerate(ORDER, start=1)]


def _stage(kind: type[Stage | LossModel], place: int) -> Entry:
    tables = tuple(f"radio.{key}." for key in kind.keys)
    keys = tuple(key for key in all_keys() if f"{key.name}.".startswith(tables))
    return Entry(
        kind="stage",
        name=kind.name,
        help=first_line(kind.__doc__),
        facts=(("place", f"{place} of {len(ORDER)}"), ("in the chain", first_line(kind.of.__doc__))),
        tables=(ParameterTable("keys", keys),) if keys else (),
        text=paragraphs(kind.__doc__),
    )
