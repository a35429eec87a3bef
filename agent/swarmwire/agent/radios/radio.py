"""What every radio of an agent on a robot is."""

from typing import NamedTuple, Protocol

from swarmwire.comms.packets import NO_TX_STATUSES, ReceivedPackets, SentPackets, TxStatuses


class RobotRadio(Protocol):
    """The radio of one robot: `received` and `send` are called from one thread, once per tick each.

    Attributes:
        needs: what of an agent's `needs` it meets: "radio.range", "radio.bearing", "radio.tx_status", …
        gives: the columns of `ReceivedPackets.given`, in their order.
    """

    needs: frozenset[str]
    measures: tuple[str, ...]

    def open(self) -> None:
        """Take part in the network."""
        ...

    def received(self, now_ns: int) -> tuple[ReceivedPackets, TxStatuses]:
        """What reached the robot since the last call, in the order that `ReceivedPackets` promises.

        `receiver` and `TxStatuses.row` are the robot's row. `now_ns` and `received_at_ns` are times since the agent's
        start.
        """
        ...

    def send(self, sent: SentPackets) -> None:
        """Hand packets to the network, at once; nothing is raised for one that is lost or too large: it is counted."""
        ...

    def counts(self) -> dict[str, int]:
        """Losses and faults so far, by name."""
        ...

    def close(self) -> None:
        """Leave the network; safe to call more than once."""
        ...


# --- The radio of a robot that has none.


class NoRadio:
    """Nothing is received; what the agent sends is counted, and goes nowhere."""

    needs: frozenset[str] = frozenset()
    measures: tuple[str, ...] = ()

    def __init__(self) -> None:
        self._unsent = 0

    def open(self) -> None:
        """There is nothing to take part in."""

    def received(self, now_ns: int) -> tuple[ReceivedPackets, TxStatuses]:
        """Nothing."""
        return ReceivedPackets.none(), NO_TX_STATUSES

    def send(self, sent: SentPackets) -> None:
        """Count the packets."""
        self._unsent += len(sent)

    def counts(self) -> dict[str, int]:
        """How many packets went nowhere."""
        return {"packets_without_radio": self._unsent} if self._unsent else {}

    def close(self) -> None:
        """There is nothing to leave."""


# --- What a robot's radio tells its log: each packet that arrived, also for others, and each that it was to send.


SENT, TOO_LARGE = "sent", "too_large"  # fates of a packet at its sender


class ReceivedPacket(NamedTuple):
    """A packet that arrived; robots are places in the swarm's list."""

    utc_ns: int  # when it arrived
    sender: int
    sequence: int
    to: int  # whom it was meant for, or BROADCAST
    size_bytes: int  # of the message, tag included
    tag: int
    latency_ns: int | None  # from the sender's clock to this robot's; None: not known
    distance_m: float | None  # None: not known
    given: bool  # whether the agent gets it


class SentPacket(NamedTuple):
    """A packet that the agent sent."""

    utc_ns: int
    sequence: int
    to: int  # a place in the swarm's list, or BROADCAST
    size_bytes: int  # of the message, tag included
    tag: int
    fate: str  # SENT or TOO_LARGE


class RadioLog(Protocol):
    """Whoever keeps them; told from the thread that calls the radio."""

    def received(self, packet: ReceivedPacket) -> None:
        """A packet arrived."""
        ...

    def sent(self, packet: SentPacket) -> None:
        """The agent sent a packet."""
        ...


class NoRadioLog:
    """Nobody keeps them."""

    def received(self, packet: ReceivedPacket) -> None:
        """Nothing is kept."""

    def sent(self, packet: SentPacket) -> None:
        """Nothing is kept."""
