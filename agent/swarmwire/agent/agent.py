"""Agent: the code that controls one robot; and the loading of an agent class by its name.

`load_agent` refuses a class before it runs, with the reason (`NoAgent`): no step method, another API version, a
parameter of another type, or a mutable class attribute, which all robots would share.
"""

import hashlib
import inspect
from abc import ABC, abstractmethod
from pathlib import Path
from typing import Any, ClassVar, cast

from swarmwire.agent.parameters import Parametrized, parameters_of
from swarmwire.agent.robot import Robot
from swarmwire.agent.vector_agent import API_VERSION, VectorAgent
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.plugins import ONNX, NotLoaded, load_named


class Agent(Parametrized, ABC):
    """Controls one robot, from the sensors and received packets of that robot alone. One instance per robot.

    Annotated class attributes (float, int, bool, str) are its parameters, set before `__init__` runs. Its memory is in
    attributes that `__init__` sets. `needs` names the sensors of the body that it reads ("proximity", "compass",
    "odometry"), the measurements of a packet that it reads ("radio.range", "radio.bearing"), and "radio.tx_status" for
    one status per unicast packet that it sends. `api = 1` in its class names the version of swarmwire.agent that it was
    written for; other versions refuse it.
    """

    api: ClassVar[int] = API_VERSION
    needs: ClassVar[tuple[str, ...]] = ()

    @abstractmethod
    def step(self, robot: Robot) -> None:
        """Read `robot`, then drive and send; called once per tick in which the robot acts."""

    def on_receive(self, robot: Robot) -> None:
        """Read packets and send, between steps, when packets have arrived in real time with a sub-tick. Optional.

        These packets are not passed to the next step again. The sensors are those of the last step; the time is now.
        Driving, LEDs, actuators and notes belong in `step`. Elsewhere (lockstep, real time without a sub-tick, a real
        robot) it is never called and all packets wait for the step, so an agent must work without it.
        """


AgentClass = type[Agent] | type[VectorAgent[Any]]  # the `agent` of a group in a scenario


class NoAgent(ValueError):
    """The text does not name a usable agent class; the message says why."""


def load_agent(spec: str) -> AgentClass:
    """Load "package.module:Class", "/path/file.py:Class" or "/path/policy.onnx"; NoAgent if it is no agent class."""
    if spec.endswith(ONNX):
        return _policy(Path(spec))
    try:
        loaded = load_named(spec)
    except NotLoaded as error:
        raise NoAgent(str(error)) from error.__cause__
    module, _, name = spec.rpartition(":")
    if not isinstance(loaded, type) or not issubclass(loaded, Agent | VectorAgent):
        raise NoAgent(f"{module} holds no Agent or VectorAgent: {name!r}")
    kind = cast(AgentClass, loaded)
    if getattr(kind, "__abstractmethods__", None):
        raise NoAgent(f"{name} has no step method")
    if kind.api != API_VERSION:
        raise NoAgent(f"{name}.api: expected {API_VERSION}, the version of this swarmwire.agent, got {kind.api!r}")
    needs: Any = kind.needs  # user code: any type
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


def _policy(path: Path) -> AgentClass:
    from swarmwire.agent.onnx_policy import policy_class  # imported late, since its modules cost memory

    try:
        return policy_class(path)
    except BadInput as error:
        raise NoAgent(str(error)) from error


def agent_sha256(kind: AgentClass) -> str:
    """Return the sha256 of an agent's source file, with which two machines check that they have the same agent.

    NoAgent for a class without a file, such as one that was typed in at a prompt.
    """
    try:
        path = inspect.getfile(kind)
        return hashlib.sha256(Path(path).read_bytes()).hexdigest()
    except (TypeError, OSError) as error:
        raise NoAgent(f"{kind.__name__} comes from no file that can be read: {error}") from error


def _is_shared(attribute: str, value: object) -> bool:
    return not attribute.startswith("__") and isinstance(value, list | dict | set)
