"""The interface of a robot's radio, the radio of a robot without a network, and records of packets for the log."""

from typing import NamedTuple, Protocol

from swarmwire.comms.robot.packets import NO_TX_STATUSES, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.robot.tick_io import SparseTable

SENT, TOO_LARGE = "sent", "too_large"  # fates of a packet at its sender


class RobotRadio(Protocol):
    """The radio of one robot: `received` and `send` are called from one thread, once per tick each.

    Attributes:
        needs: needs of agents that the radio meets: "radio.range", "radio.bearing", "radio.tx_status", …
        measures: the columns of `ReceivedPackets.measured`, in their order.
    """

    needs: frozenset[str]
    measures: tuple[str, ...]

    def open(self) -> None:
        """Join the network."""
        ...

    def received(self, now_ns: int) -> tuple[ReceivedPackets, TxStatuses]:
        """Return packets and tx statuses since the last call, in the order of `ReceivedPackets`.

        `receiver` and `TxStatuses.row` are the robot's row. `now_ns` and `received_at_ns` are times since the agent's
        start.
        """
        ...

    def send(self, sent: SentPackets) -> None:
        """Send packets at once; lost and too large ones are counted, without an error."""
        ...

    def note(self, states: SparseTable, values: SparseTable) -> None:
        """Pass the agent's notes to a world's records; only the radio of a world has these."""
        ...

    def counts(self) -> dict[str, int]:
        """Return the numbers of losses and faults so far, by name."""
        ...

    def close(self) -> None:
        """Leave the network; safe to call more than once."""
        ...


class NoRadio:
    """A radio that receives nothing, and counts and drops the agent's packets."""

    needs: frozenset[str] = frozenset()
    measures: tuple[str, ...] = ()

    def __init__(self) -> None:
        self._unsent = 0

    def open(self) -> None:
        """Do nothing: there is no network."""

    def received(self, now_ns: int) -> tuple[ReceivedPackets, TxStatuses]:
        """Return no packets and no statuses."""
        return ReceivedPackets.none(), NO_TX_STATUSES

    def send(self, sent: SentPackets) -> None:
        """Count the packets."""
        self._unsent += len(sent)

    def note(self, states: SparseTable, values: SparseTable) -> None:
        """Do nothing: there is no world."""

    def counts(self) -> dict[str, int]:
        """Return the number of dropped packets, by name."""
        return {"packets_without_radio": self._unsent} if self._unsent else {}

    def close(self) -> None:
        """Do nothing: there is no network."""


class ReceivedPacket(NamedTuple):
    """A packet that arrived, for this robot or for another; robots are indices in the swarm."""

    utc_ns: int  # time of arrival
    sender: int
    sequence: int
    to: int  # index of the addressed robot, or BROADCAST
    size_bytes: int  # size of the message, tag included
    tag: int
    latency_ns: int | None  # receive time by this robot's clock - send time by the sender's; None: unknown
    distance_m: float | None  # None: unknown
    delivered: bool  # True if the agent receives it


class SentPacket(NamedTuple):
    """A packet that the agent sent."""

    utc_ns: int
    sequence: int
    to: int  # index in the swarm, or BROADCAST
    size_bytes: int  # size of the message, tag included
    tag: int
    fate: str  # SENT or TOO_LARGE


class RadioLog(Protocol):
    """Logs packets; called from the thread that calls the radio."""

    def received(self, packet: ReceivedPacket) -> None:
        """Log a packet that arrived."""
        ...

    def sent(self, packet: SentPacket) -> None:
        """Log a packet that the agent sent."""
        ...


class NoRadioLog:
    """A log without records."""

    def received(self, packet: ReceivedPacket) -> None:
        """Do nothing."""

    def sent(self, packet: SentPacket) -> None:
        """Do nothing."""
