"""The interface of radios of an agent on a robot, the radio of a robot without one, and the packets for its log."""

from typing import NamedTuple, Protocol

from swarmwire.comms.robot.packets import NO_TX_STATUSES, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.robot.tick_io import SparseTable

SENT, TOO_LARGE = "sent", "too_large"  # fates of a packet at its sender


class RobotRadio(Protocol):
    """The radio of one robot: `received` and `send` are called from one thread, once per tick each.

    Attributes:
        needs: the needs of agents that it meets: "radio.range", "radio.bearing", "radio.tx_status", …
        measures: the columns of `ReceivedPackets.measured`, in their order.
    """

    needs: frozenset[str]
    measures: tuple[str, ...]

    def open(self) -> None:
        """Join the network."""
        ...

    def received(self, now_ns: int) -> tuple[ReceivedPackets, TxStatuses]:
        """Packets and tx statuses since the last call, in the order that `ReceivedPackets` promises.

        `receiver` and `TxStatuses.row` are the robot's row. `now_ns` and `received_at_ns` are times since the agent's
        start.
        """
        ...

    def send(self, sent: SentPackets) -> None:
        """Send packets at once; one that is lost or too large raises nothing and is counted."""
        ...

    def note(self, states: SparseTable, values: SparseTable) -> None:
        """Pass what the agent noted to the records of a world, if the radio is that of one."""
        ...

    def counts(self) -> dict[str, int]:
        """Losses and faults so far, by name."""
        ...

    def close(self) -> None:
        """Leave the network; safe to call more than once."""
        ...


class NoRadio:
    """The radio of a robot without one: nothing is received; packets of the agent are counted and dropped."""

    needs: frozenset[str] = frozenset()
    measures: tuple[str, ...] = ()

    def __init__(self) -> None:
        self._unsent = 0

    def open(self) -> None:
        """There is nothing to join."""

    def received(self, now_ns: int) -> tuple[ReceivedPackets, TxStatuses]:
        """Nothing."""
        return ReceivedPackets.none(), NO_TX_STATUSES

    def send(self, sent: SentPackets) -> None:
        """Count the packets."""
        self._unsent += len(sent)

    def note(self, states: SparseTable, values: SparseTable) -> None:
        """There is no world."""

    def counts(self) -> dict[str, int]:
        """Number of dropped packets."""
        return {"packets_without_radio": self._unsent} if self._unsent else {}

    def close(self) -> None:
        """There is nothing to leave."""


class ReceivedPacket(NamedTuple):
    """A packet that arrived, also one for another robot; robots are indices in the swarm."""

    utc_ns: int  # time of arrival
    sender: int
    sequence: int
    to: int  # index of the addressed robot, or BROADCAST
    size_bytes: int  # of the message, tag included
    tag: int
    latency_ns: int | None  # from the sender's clock to this robot's; None: unknown
    distance_m: float | None  # None: unknown
    given: bool  # whether the agent receives it


class SentPacket(NamedTuple):
    """A packet that the agent sent."""

    utc_ns: int
    sequence: int
    to: int  # index in the swarm, or BROADCAST
    size_bytes: int  # of the message, tag included
    tag: int
    fate: str  # SENT or TOO_LARGE


class RadioLog(Protocol):
    """Logs packets; called from the thread that calls the radio."""

    def received(self, packet: ReceivedPacket) -> None:
        """A packet arrived."""
        ...

    def sent(self, packet: SentPacket) -> None:
        """The agent sent a packet."""
        ...


class NoRadioLog:
    """Logs nothing."""

    def received(self, packet: ReceivedPacket) -> None:
        """Log nothing."""

    def sent(self, packet: SentPacket) -> None:
        """Log nothing."""
