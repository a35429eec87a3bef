"""The local crew: all agents of a run in this process."""

from swarmwire.agent.host import Host
from swarmwire.comms.assignment import Assignment
from swarmwire.comms.packets import Heard
from swarmwire.comms.senses import Actions, Senses


class LocalCrew:
    """A Crew whose agents are called directly; arrays are passed, messages are encoded and decoded all the same."""

    def __init__(self, assignment: Assignment) -> None:
        self._assignment = assignment
        self._host: Host | None = None

    def start(self) -> None:
        """Make the agents."""
        self._host = Host(self._assignment)

    def act(self, tick: int, senses: Senses, heard: Heard) -> Actions:
        """What every robot does in this tick."""
        if self._host is None:
            raise RuntimeError("the crew has not been started")
        return self._host.act(tick, senses, heard)

    def counts(self) -> dict[str, int]:
        """Nothing is lost within a process."""
        return {}

    def close(self) -> None:
        """Forget the agents."""
        self._host = None
