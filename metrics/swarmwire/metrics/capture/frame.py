"""A frame on air, as a capture shows it."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Frame:
    """A packet that was on air, once for all of its receivers; of one that was sent again, the last time."""

    on_air_at_ns: int  # since the start of the run
    sender: int  # index in the arena
    to: int | None  # index of the one that it is addressed to; None: a broadcast
    sequence: int  # packets that the sender had sent before
    size_bytes: int  # payload
    payload: bytes = b""  # as far as it is known
    rssi_dbm: float | None = None  # at the receiver where it was strongest; None: unknown
    comments: tuple[str, ...] = ()  # what it is, and what became of it where
