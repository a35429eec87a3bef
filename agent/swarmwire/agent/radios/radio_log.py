"""What a robot's radio tells its log: each packet that arrived, also for others, and each that it was to send."""

from typing import NamedTuple, Protocol

SENT, TOO_LARGE = "sent", "too_large"  # fates of a packet at its sender


class HeardPacket(NamedTuple):
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

    def heard(self, packet: HeardPacket) -> None:
        """A packet arrived."""
        ...

    def sent(self, packet: SentPacket) -> None:
        """The agent sent a packet."""
        ...


class NoRadioLog:
    """Nobody keeps them."""

    def heard(self, packet: HeardPacket) -> None:
        """Nothing is kept."""

    def sent(self, packet: SentPacket) -> None:
        """Nothing is kept."""
