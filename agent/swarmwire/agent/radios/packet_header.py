"""The header of a packet on the robots' network: what an emulated packet needs not say, before the message.

    >>> PacketHeader(to=-1, sequence=7, sent_utc_ns=1_767_225_600_000_000_000).encode().hex()
    '01ffff070000000000faed51728618'

The sender stands in the key, where access control can see it; the message is encoded as in emulation.
"""

import struct
from typing import NamedTuple

from swarmwire.comms.errors import BadFrame
from swarmwire.comms.packets import BROADCAST

VERSION = 1
_LAYOUT = struct.Struct("<BhIq")  # version, to, sequence, sent_utc_ns
HEADER_BYTES = _LAYOUT.size
SEQUENCES = 2**32  # after so many packets a sender counts from 0 again


class PacketHeader(NamedTuple):
    """What stands before each message."""

    to: int  # index of the one receiver, or BROADCAST
    sequence: int  # how many packets the sender had sent before this one
    sent_utc_ns: int  # by the sender's clock

    def encode(self) -> bytes:
        """The bytes of the header."""
        return _LAYOUT.pack(VERSION, self.to, self.sequence % SEQUENCES, self.sent_utc_ns)

    @classmethod
    def decode(cls, packet: bytes) -> "PacketHeader":
        """The header at the start of a packet; BadFrame ("malformed") if there is none."""
        if len(packet) < HEADER_BYTES:
            raise BadFrame("malformed", f"{len(packet)} bytes, expected {HEADER_BYTES} before the message")
        version, to, sequence, sent_utc_ns = _LAYOUT.unpack_from(packet)
        if version != VERSION or to < BROADCAST:
            raise BadFrame("malformed", f"version {version} to {to}, expected {VERSION} and {BROADCAST} or more")
        return cls(to, sequence, sent_utc_ns)
