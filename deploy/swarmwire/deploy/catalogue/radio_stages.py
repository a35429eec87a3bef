"""Stages of the radio: what a packet passes on its way to a receiver, in order."""

import inspect
from types import ModuleType

from swarmwire.comms.air.stages.chain import ORDER
from swarmwire.comms.air.stages.stage import Stage
from swarmwire.deploy.catalogue.docs import first_line, paragraphs
from swarmwire.deploy.catalogue.entry import Entry, ParameterTable
from swarmwire.deploy.catalogue.scenario_keys import all_keys


def radio_stages() -> list[Entry]:
    """The stages of the chain, in order."""
    return [_stage(module, place) for place, module in enumerate(ORDER, start=1)]


def _stage(module: ModuleType, place: int) -> Entry:
    name = module.__name__.rpartition(".")[2]
    own = [of for of in vars(module).values() if getattr(of, "__module__", "") == module.__name__]
    stages = [of for of in own if isinstance(of, type) and issubclass(of, Stage)]
    formulas = [of for of in own if not isinstance(of, type) and of is not module.__dict__["stage"]]
    texts = [inspect.getdoc(of) for of in (*stages, *formulas)]
    tables = tuple(f"radio.{key}." for key in module.__dict__["KEYS"])
    keys = tuple(key for key in all_keys() if f"{key.name}.".startswith(tables))
    return Entry(
        kind="stage",
        name=name,
        help=first_line(module.__doc__),
        facts=(("place", f"{place} of {len(ORDER)}"), ("in the chain", first_line(module.__dict__["stage"].__doc__))),
        tables=(ParameterTable("keys", keys),) if keys else (),
        text="\n\n".join(paragraphs(text) for text in texts if text),
    )
