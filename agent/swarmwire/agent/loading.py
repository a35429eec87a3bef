"""From the text that names an agent to its class."""

import hashlib
import importlib
import importlib.util
import sys
from pathlib import Path
from typing import Any, cast

from swarmwire.agent.agent import Agent
from swarmwire.agent.declared import parameters_of
from swarmwire.agent.vector_agent import VectorAgent

AgentClass = type[Agent] | type[VectorAgent[Any]]


class NoAgent(ValueError):
    """The text does not lead to an agent class; the message says at which point."""


def resolve(spec: str, beside: Path) -> str:
    """The spec with the path of a file made absolute: "my_agent.py:Mine" lies beside the scenario."""
    place, _, name = spec.rpartition(":")
    return f"{(beside / place).resolve()}:{name}" if place.endswith(".py") else spec


def load_agent(spec: str) -> AgentClass:
    """The class of "package.module:Class" or "/path/file.py:Class"; NoAgent if it is none."""
    place, _, name = spec.rpartition(":")
    if not place or not name.isidentifier():
        raise NoAgent(f'expected "package.module:Class" or "file.py:Class", got {spec!r}')
    of_file = place.endswith(".py")
    if of_file and not Path(place).is_file():
        raise NoAgent(f"there is no file {place}")
    try:
        module = _load_file(Path(place)) if of_file else importlib.import_module(place)
    except (Exception, SystemExit) as error:
        raise NoAgent(f"{place} does not import: {type(error).__name__}: {error}") from error
    found: object = getattr(module, name, None)
    if not isinstance(found, type) or not issubclass(found, Agent | VectorAgent):
        what = "no such name" if found is None else "no Agent or VectorAgent"
        raise NoAgent(f"{place} holds {what}: {name!r}")
    kind = cast(AgentClass, found)
    if getattr(kind, "__abstractmethods__", None):
        raise NoAgent(f"{name} has no step method")
    needs: Any = kind.needs  # the user's: it may be anything
    if type(needs) is not tuple or not all(type(need) is str for need in cast("tuple[object, ...]", needs)):
        raise NoAgent(f'{name}.needs: expected a tuple of texts such as ("proximity",), got {needs!r}')
    try:
        parameters_of(kind)
    except (TypeError, NameError) as error:
        raise NoAgent(str(error)) from error
    return kind


def _load_file(path: Path) -> Any:
    # A name of its own, so that two files called agent.py do not meet in sys.modules.
    name = f"swarmwire_user_{path.stem}_{hashlib.sha256(str(path).encode()).hexdigest()[:12]}"
    if name in sys.modules:
        return sys.modules[name]
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise FileNotFoundError(path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except BaseException:  # also an exit or Ctrl-C: a half-imported module must not be found the next time
        del sys.modules[name]
        raise
    return module
