"""The robots' side: write an `Agent` for one robot, or a `VectorAgent` for n at a time, and it runs anywhere."""

from swarmwire.agent.agent import Agent
from swarmwire.agent.packet import Packet, TxStatus
from swarmwire.agent.robot import Robot
from swarmwire.agent.robots import Robots
from swarmwire.agent.vector_agent import (
    API_VERSION,
    BoolColumn,
    FloatColumn,
    IntColumn,
    PerRobot,
    State,
    VectorAgent,
    column,
    per_robot,
)
from swarmwire.comms.messages import Message, f4, f8, i1, i2, i4, u1, u2, u4
from swarmwire.comms.packets import TxResult, TxStatuses

__all__ = [
    "API_VERSION",
    "Agent",
    "BoolColumn",
    "FloatColumn",
    "IntColumn",
    "Message",
    "Packet",
    "PerRobot",
    "Robot",
    "Robots",
    "State",
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
    "per_robot",
    "u1",
    "u2",
    "u4",
]
