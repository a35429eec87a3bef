"""A runner without a network: its protocol, and a process per robot, frame by frame."""

from collections.abc import Callable

import numpy as np

from swarmwire.agent.runner_protocol import Assigned, JoinOptions, RunnerProtocol, Tick
from swarmwire.comms.base.errors import AgentFailed
from swarmwire.comms.wire.join import JoinRequest
from tests.support.agent.processes import Processes


def assigned_robots(reply: bytes) -> Assigned:
    """The robots in a world's reply to a request to join."""
    return joining().receive_assignment(reply)


def joining() -> RunnerProtocol:
    """The protocol of a runner that has found its world."""
    protocol = RunnerProtocol()
    protocol.world_present(True)
    return protocol


class EncodedRunner:
    """A runner that has joined; `ready` is its first frame."""

    def __init__(self, join: Callable[[bytes], bytes], request: JoinRequest | None = None) -> None:
        """`join` is the world: it answers a request with an assignment."""
        self._protocol = joining()
        assigned = self._protocol.receive_assignment(join(self._protocol.join(JoinOptions(request or JoinRequest()))))
        robots = sum(len(group.rows) for group in assigned.assignment.groups)
        self._keeps_memory = assigned.memory is not None
        self._processes = Processes(assigned.assignment, robots, assigned.memory)
        self.ready = self._protocol.ready(robots)

    def answer(self, data: bytes) -> bytes:
        """The answer to a frame "tick"."""
        self._protocol.receive_frame(data)
        event = self._protocol.next_event()
        assert isinstance(event, Tick)
        try:
            actions = self._processes.act(*event)
        except AgentFailed as error:
            rows = np.concatenate([group.rows for group in self._processes.assignment.groups])
            return self._protocol.lose(rows, "0", "its agent failed", error.robots, error.traceback)
        if not self._keeps_memory:
            return self._protocol.answer(actions)
        return self._protocol.answer(actions, self._processes.memory)
