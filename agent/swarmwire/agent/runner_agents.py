"""The agents of a runner, between its protocol and their executor, without any I/O."""

import traceback
from contextlib import suppress

import numpy as np

from swarmwire.agent.agent import NoAgent, load_agent
from swarmwire.agent.host import AgentExecutor, layout_of
from swarmwire.agent.runner_protocol import Assigned, PacketsBetween, PacketsReceived, RunnerProtocol, Tick
from swarmwire.comms.errors import AgentFailed, BadFrame
from swarmwire.comms.wire.agent_memory import Memory, decode_memory


def make_executor(assigned: Assigned) -> AgentExecutor:
    """The agents of the assigned robots, with the memory of earlier agents where it fits. Errors as `AgentExecutor`."""
    assignment, frame = assigned
    memory: Memory = {}
    if frame is not None:
        for group in assignment.groups:
            with suppress(BadFrame, NoAgent):  # without memory it starts with defaults; a missing agent fails below
                decoded = decode_memory(frame, {group.name: layout_of(load_agent(group.agent))})
                if all(np.isin(of_group.rows, group.rows).all() for of_group in decoded.values()):
                    memory |= decoded
    return AgentExecutor(assignment, memory)


class RunnerAgents:
    """The agents of a runner: it acts on the events of the protocol, and returns the frames to put."""

    _executor: AgentExecutor  # from the assignment on

    def __init__(self, protocol: RunnerProtocol, assigned: Assigned) -> None:
        self._protocol, self._assigned = protocol, assigned

    def handle(self, event: Assigned | Tick | PacketsReceived | PacketsBetween) -> bytes | None:
        """Act on the assignment, which comes first, or on an event: a frame to put, or None.

        A failure of the agents is a frame, too.
        """
        try:
            return self._handle(event)
        except AgentFailed as error:
            return self._protocol.fail(error.robots, error.traceback)
        except Exception:  # noqa: BLE001 - whatever it is, the world must learn of it
            return self._protocol.fail(self._assigned.assignment.robots_text, traceback.format_exc())

    def _handle(self, event: Assigned | Tick | PacketsReceived | PacketsBetween) -> bytes | None:
        match event:
            case Tick():
                actions = self._executor.act(*event)
                keeps_memory = self._assigned.memory is not None
                return self._protocol.answer(actions, self._executor.memory(event.readings) if keeps_memory else None)
            case PacketsReceived():
                self._executor.receive(*event)
                return None
            case PacketsBetween():
                sent = self._executor.on_receive(*event)
                return self._protocol.send(event.tick, sent) if len(sent) else None
            case Assigned():
                self._executor = make_executor(event)
                return self._protocol.ready()
