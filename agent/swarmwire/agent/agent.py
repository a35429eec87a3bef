"""Agent: the code that decides for one robot."""

import hashlib
import inspect
from abc import ABC, abstractmethod
from pathlib import Path
from typing import Any, ClassVar, cast

from swarmwire.agent.api_version import API_VERSION
from swarmwire.agent.parameters import parameters_of
from swarmwire.agent.robot import Robot
from swarmwire.agent.vector_agent import VectorAgent
from swarmwire.comms.plugins import NotLoaded, load_named


class Agent(ABC):
    """Decides for one robot, from what that robot alone senses and hears. One instance per robot.

    Annotated class attributes (float, int, bool, str) are its parameters, set before `__init__` runs; what it should
    remember it keeps in attributes of its own, made in `__init__`. `needs` names the senses of the body that it reads
    ("proximity", "compass", "odometry"), what it reads of a packet ("radio.range", "radio.bearing"), and
    "radio.tx_status" if it wants to know what became of packets that it sent to one robot. `api = 1` in its class says
    for which version of swarmwire.agent it was written: any other refuses it.
    """

    api: ClassVar[int] = API_VERSION
    needs: ClassVar[tuple[str, ...]] = ()

    @abstractmethod
    def step(self, robot: Robot) -> None:
        """Called once a tick in which the robot acts: read `robot`, then drive and send."""

    def on_receive(self, robot: Robot) -> None:  # noqa: B027 - most agents read in `step` alone
        """If it is defined: called between steps when packets have come, in real time with a subtick; read and send.

        What it is given, the next step is not. The senses are those of the last step, the time is now. Driving, lights,
        actuators and notes are for `step`. Elsewhere (lockstep, real time without a subtick, a real robot) it is never
        called, and all packets wait for the step: an agent must do without.
        """


# --- From the text that names an agent to its class.


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
