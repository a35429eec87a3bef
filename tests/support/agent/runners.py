"""A runner without a network: its protocol and its agents, frame by frame."""

from collections.abc import Callable

from swarmwire.agent.runner_agents import RunnerAgents
from swarmwire.agent.runner_protocol import Assigned, Ended, JoinOptions, RunnerProtocol
from swarmwire.comms.wire.join import JoinRequest


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
        self._agents = RunnerAgents(self._protocol, assigned)
        self.ready = self._agents.handle(assigned) or b""

    def answer(self, data: bytes) -> bytes:
        """The answer to a frame."""
        self._protocol.receive_frame(data)
        event = self._protocol.next_event()
        assert event is not None
        assert not isinstance(event, Ended)
        answer = self._agents.handle(event)
        assert answer is not None
        return answer
