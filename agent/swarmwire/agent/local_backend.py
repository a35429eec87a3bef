"""The local backend: all agents of a run in this process.

Arrays from the wire are read-only. These arrays belong to the world, so agents get read-only views.
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
        """Return the actions of all robots in this tick."""
        return self._started().act(tick, _read_only_readings(readings), _read_only_packets(received), tx_status)

    def receive(self, received: ReceivedPackets, tx_status: TxStatuses) -> None:
        """Keep packets and statuses until their robots step or read them."""
        self._started().receive(_read_only_packets(received), tx_status)

    def on_receive(self, tick: int, at_ns: int) -> SentPackets:
        """Call `on_receive` of agents that define it, at a time in this tick; return their packets."""
        return self._started().on_receive(tick, at_ns)

    def counts(self) -> dict[str, int]:
        """Return no counters: nothing is lost within a process."""
        return {}

    def close(self) -> None:
        """Drop the agents."""
        self._executor = None

    def _started(self) -> AgentExecutor:
        if self._executor is None:
            raise RuntimeError("the backend has not been started")
        return self._executor


def _read_only(array: AnyArray) -> AnyArray:
    view = array.view()
    view.setflags(write=False)
    return view


def _read_only_readings(readings: Readings) -> Readings:
    return {
        name: GroupReadings(
            _read_only(group.rows), {field: _read_only(column) for field, column in group.fields.items()}
        )
        for name, group in readings.items()
    }


def _read_only_packets(received: ReceivedPackets) -> ReceivedPackets:
    if not len(received):
        return received
    return ReceivedPackets(
        _read_only(received.receiver),
        _read_only(received.sender_index),
        _read_only(received.sequence),
        _read_only(received.received_at_ns),
        {name: _read_only(column) for name, column in received.measured.items()},
        _read_only(received.payload),
        Payloads(_read_only(received.payloads.data), _read_only(received.payloads.offset)),
    )
