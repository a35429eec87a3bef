"""The robots' side: write an `Agent` for one robot, or a `VectorAgent` for n at a time, and it runs anywhere."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from swarmwire.agent.agent import Agent
    from swarmwire.agent.packet import Packet, TxStatus
    from swarmwire.agent.parameters import PerRobot
    from swarmwire.agent.robot import Robot
    from swarmwire.agent.robots import Robots
    from swarmwire.agent.vector_agent import (
        API_VERSION,
        BoolColumn,
        FloatColumn,
        IntColumn,
        Memory,
        VectorAgent,
        column,
    )
    from swarmwire.comms.base.config import parameter
    from swarmwire.comms.robot.messages import Message, f4, f8, i1, i2, i4, u1, u2, u4
    from swarmwire.comms.robot.packets import TxResult, TxStatuses

__all__ = [
    "API_VERSION",
    "Agent",
    "BoolColumn",
    "FloatColumn",
    "IntColumn",
    "Memory",
    "Message",
    "Packet",
    "PerRobot",
    "Robot",
    "Robots",
    "TxResult",
    "TxStatus",
    "TxStatuses",
    "VectorAgent",
    "column",
    "f4",
    "f8",
    "i1",
    "i2",
    "i4",
    "parameter",
    "u1",
    "u2",
    "u4",
]

_MODULES = {
    "Agent": "swarmwire.agent.agent",
    "Packet": "swarmwire.agent.packet",
    "PerRobot": "swarmwire.agent.parameters",
    "parameter": "swarmwire.comms.base.config",
    "Robot": "swarmwire.agent.robot",
    "Robots": "swarmwire.agent.robots",
    "TxResult": "swarmwire.comms.robot.packets",
    "TxStatus": "swarmwire.agent.packet",
    "TxStatuses": "swarmwire.comms.robot.packets",
    **dict.fromkeys(("Message", "f4", "f8", "i1", "i2", "i4", "u1", "u2", "u4"), "swarmwire.comms.robot.messages"),
}  # all other names are in `vector_agent`


def __getattr__(name: str) -> Any:
    """Import on first use: `swarmwire-agent stop-motors` must not wait for the interfaces of agents."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_MODULES.get(name, "swarmwire.agent.vector_agent")), name)


def __dir__() -> list[str]:
    return __all__
