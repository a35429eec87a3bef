"""The local backend: all agents of a run in this process."""

from swarmwire.agent.host import AgentExecutor
from swarmwire.comms.arrays import AnyArray
from swarmwire.comms.assignment import Assignment
from swarmwire.comms.packets import NO_TX_STATUSES, Payloads, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.tick_io import Actions, GroupReadings, Readings


class LocalBackend:
    """A AgentBackend whose agents are called directly.

    Arrays are passed, messages are encoded and decoded all the same.
    """

    def __init__(self, assignment: Assignment) -> None:
        self._assignment = assignment
        self._host: AgentExecutor | None = None

    def start(self) -> None:
        """Make the agents."""
        self._host = AgentExecutor(self._assignment)

    def act(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses = NO_TX_STATUSES
    ) -> Actions:
        """What every robot does in this tick."""
        return self._started().act(tick, _read_only(readings), _received_read_only(received), tx_status)

    def receive(self, received: ReceivedPackets, tx_status: TxStatuses) -> None:
        """Keep this until the robots that it is for step, or hear."""
        self._started().receive(_received_read_only(received), tx_status)

    def on_receive(self, tick: int, at_ns: int) -> SentPackets:
        """Let agents that read between ticks read, at a time in this tick; what they sent."""
        return self._started().on_receive(tick, at_ns)

    def counts(self) -> dict[str, int]:
        """Nothing is lost within a process."""
        return {}

    def close(self) -> None:
        """Forget the agents."""
        self._host = None

    def _started(self) -> AgentExecutor:
        if self._host is None:
            raise RuntimeError("the backend has not been started")
        return self._host


# What comes over the wire cannot be written to; what is handed over here must not be either, since it is the world's.


def _frozen(array: AnyArray) -> AnyArray:
    view = array.view()
    view.setflags(write=False)
    return view


def _read_only(readings: Readings) -> Readings:
    return {
        name: GroupReadings(_frozen(group.rows), {field: _frozen(column) for field, column in group.fields.items()})
        for name, group in readings.items()
    }


def _received_read_only(received: ReceivedPackets) -> ReceivedPackets:
    if not len(received):
        return received
    return ReceivedPackets(
        _frozen(received.receiver),
        _frozen(received.sender),
        _frozen(received.sequence),
        _frozen(received.received_at_ns),
        {name: _frozen(column) for name, column in received.given.items()},
        _frozen(received.payload),
        Payloads(_frozen(received.payloads.data), _frozen(received.payloads.offset)),
    )
