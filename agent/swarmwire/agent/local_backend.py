"""The local backend: all agents of a run in this process.

Arrays from the wire are read-only. The arrays passed here belong to the world, so they are made read-only as well.
"""

from swarmwire.agent.executor import AgentExecutor
from swarmwire.comms.base.arrays import AnyArray
from swarmwire.comms.robot.packets import NO_TX_STATUSES, Payloads, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions, GroupReadings, Readings
from swarmwire.comms.wire.assignment import Assignment


class LocalBackend:
    """An AgentBackend that calls its agents directly; messages are still encoded and decoded."""

    def __init__(self, assignment: Assignment) -> None:
        self._assignment = assignment
        self._executor: AgentExecutor | None = None

    def start(self) -> None:
        """Make the agents."""
        self._executor = AgentExecutor(self._assignment)

    def act(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses = NO_TX_STATUSES
    ) -> Actions:
        """The actions of all robots in this tick."""
        return self._started().act(tick, _read_only(readings), _received_read_only(received), tx_status)

    def receive(self, received: ReceivedPackets, tx_status: TxStatuses) -> None:
        """Keep this until its robots step or read it."""
        self._started().receive(_received_read_only(received), tx_status)

    def on_receive(self, tick: int, at_ns: int) -> SentPackets:
        """Call `on_receive` of agents that define it, at a time in this tick; returns their packets."""
        return self._started().on_receive(tick, at_ns)

    def counts(self) -> dict[str, int]:
        """Empty: nothing is lost within a process."""
        return {}

    def close(self) -> None:
        """Drop the agents."""
        self._executor = None

    def _started(self) -> AgentExecutor:
        if self._executor is None:
            raise RuntimeError("the backend has not been started")
        return self._executor


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
        _frozen(received.sender_index),
        _frozen(received.sequence),
        _frozen(received.received_at_ns),
        {name: _frozen(column) for name, column in received.measured.items()},
        _frozen(received.payload),
        Payloads(_frozen(received.payloads.data), _frozen(received.payloads.offset)),
    )
