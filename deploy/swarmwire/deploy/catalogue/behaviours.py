"""Behaviours: the agents that come with swarmwire, and any other agent class by its text in a scenario."""

from abc import ABC
from pathlib import Path
from typing import Generic

from swarmwire.agent import Agent, VectorAgent
from swarmwire.agent import behaviours as shipped
from swarmwire.agent.agent import AgentClass, NoAgent, load_agent
from swarmwire.agent.parameters import REQUIRED, TYPES, parameters_of
from swarmwire.agent.parameters import Parameter as Declared
from swarmwire.comms.errors import BadInput
from swarmwire.comms.plugins import resolve
from swarmwire.deploy.catalogue.docs import comments_of, first_line, texts_of
from swarmwire.deploy.catalogue.entry import Entry, Parameter, ParameterTable
from swarmwire.deploy.catalogue.units import unit_of

BASES = (Agent, VectorAgent, ABC, Generic, object)


def behaviours() -> list[Entry]:
    """The agents that come with swarmwire."""
    return [behaviour(f"{shipped.__name__}:{name}") for name in shipped.__all__]


def behaviour(spec: str) -> Entry:
    """The agent class of "module:Class" or "file.py:Class", a file's path seen from here; BadInput if there is none."""
    try:
        kind = load_agent(resolve(spec, Path.cwd()))
    except NoAgent as error:
        raise BadInput(spec, "", str(error)) from error
    return _entry(kind, spec)


def _entry(kind: AgentClass, spec: str) -> Entry:
    declared = parameters_of(kind)
    comments = comments_of(kind, declared)
    parameters = tuple(_parameter(of, comments.get(name, "")) for name, of in declared.items())
    text = texts_of(kind, BASES)
    vector = issubclass(kind, VectorAgent)
    return Entry(
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


def _parameter(of: Declared, comment: str) -> Parameter:
    required = of.default is REQUIRED
    each = ", or a list with one for each robot" if of.per_robot else ""
    value = None if required else of.default
    return Parameter(of.name, comment, unit_of(of.name), value, required, TYPES[of.type] + each)
