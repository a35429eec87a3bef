"""From the text that names an agent to its class."""

import hashlib
import inspect
from pathlib import Path
from typing import Any, cast

from swarmwire.agent.agent import Agent
from swarmwire.agent.api_version import API_VERSION
from swarmwire.agent.declared import parameters_of
from swarmwire.agent.vector_agent import VectorAgent
from swarmwire.comms.plugins import NotLoaded, load_named

AgentClass = type[Agent] | type[VectorAgent[Any]]  # what a scenario's `agent` names


class NoAgent(ValueError):
    """The text does not lead to an agent class; the message says at which point."""


def load_agent(spec: str) -> AgentClass:
    """The class of "package.module:Class" or "/path/file.py:Class"; NoAgent if it is none."""
    try:
        found = load_named(spec)
    except NotLoaded as error:
        raise NoAgent(str(error)) from error.__cause__
    place, _, name = spec.rpartition(":")
    if not isinstance(found, type) or not issubclass(found, Agent | VectorAgent):
        raise NoAgent(f"{place} holds no Agent or VectorAgent: {name!r}")
    kind = cast(AgentClass, found)
    if getattr(kind, "__abstractmethods__", None):
        raise NoAgent(f"{name} has no step method")
    if kind.api != API_VERSION:
        raise NoAgent(f"{name}.api: expected {API_VERSION}, which swarmwire.agent has here, got {kind.api!r}")
    needs: Any = kind.needs  # the user's: it may be anything
    if type(needs) is not tuple or not all(type(need) is str for need in cast("tuple[object, ...]", needs)):
        raise NoAgent(f'{name}.needs: expected a tuple of texts such as ("proximity",), got {needs!r}')
    shared = [attribute for base in kind.__mro__ for attribute in vars(base).items() if _is_shared(*attribute)]
    if shared:
        attribute, value = shared[0]
        raise NoAgent(f"{name}.{attribute}: a {type(value).__name__} that all robots would share: make it in __init__")
    try:
        parameters_of(kind)
    except (TypeError, NameError) as error:
        raise NoAgent(str(error)) from error
    return kind


def agent_sha256(kind: AgentClass) -> str:
    """The sha256 of the file in which an agent's class is defined, by which two machines tell that they have the same.

    NoAgent if it has none: a class that was typed in at a prompt.
    """
    try:
        path = inspect.getfile(kind)
        return hashlib.sha256(Path(path).read_bytes()).hexdigest()
    except (TypeError, OSError) as error:
        raise NoAgent(f"{kind.__name__} comes from no file that can be read: {error}") from error


def _is_shared(attribute: str, value: object) -> bool:
    return not attribute.startswith("__") and isinstance(value, list | dict | set)
