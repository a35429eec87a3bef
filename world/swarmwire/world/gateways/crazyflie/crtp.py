"""CRTP, the Crazyflie's protocol: packets of a port, a channel and up to 30 bytes, one in a datagram.

Sources: crazyflie-firmware docs/functional-areas/crtp; cflib/crtp/udpdriver.py for the datagrams.
"""

from enum import IntEnum
from typing import NamedTuple
from zlib import crc32

from swarmwire.comms.base.errors import BadFrame

MAX_DATA_BYTES = 30
LINK_BITS = 0x0C  # bits of the header that are set in all packets, for the bootloader


class Port(IntEnum):
    """The port of a packet, which selects a service."""

    CONSOLE = 0x0
    PARAM = 0x2
    COMMANDER = 0x3
    MEMORY = 0x4
    LOG = 0x5
    LOCALIZATION = 0x6
    SETPOINT = 0x7
    HIGH_LEVEL = 0x8
    SUPERVISOR = 0x9
    PLATFORM = 0xD
    LINK = 0xF


class CrtpPacket(NamedTuple):
    """A packet."""

    port: int
    channel: int
    data: bytes

    def encoded(self) -> bytes:
        """Return the datagram."""
        return bytes([self.port << 4 | LINK_BITS | self.channel]) + self.data


def decoded(datagram: bytes) -> CrtpPacket:
    """Return the packet in a datagram; BadFrame for a datagram of impossible size.

    >>> decoded(CrtpPacket(Port.LINK, 1, b"ab").encoded())
    CrtpPacket(port=15, channel=1, data=b'ab')
    """
    if not 1 <= len(datagram) <= 1 + MAX_DATA_BYTES:
        raise BadFrame("malformed", f"expected 1 to {1 + MAX_DATA_BYTES} bytes, got {len(datagram)}")
    return CrtpPacket(datagram[0] >> 4, datagram[0] & 3, datagram[1:])


class Errno(IntEnum):
    """Results of commands, with the firmware's numbers."""

    OK = 0
    ENOENT = 2
    EIO = 5
    E2BIG = 7
    ENOEXEC = 8
    ENOMEM = 12
    EACCES = 13
    EEXIST = 17
    EINVAL = 22


class Toc:
    """A table of contents: the type, group and name of each item by its number, and a checksum for clients' caches."""

    def __init__(self, items: dict[str, int]) -> None:
        """`items` maps "group.name" to the code of its type, with its flags."""
        self.names = tuple(items)
        self._items = [bytes([code]) + name.replace(".", "\0").encode() + b"\0" for name, code in items.items()]
        self._crc = crc32(b"".join(self._items))

    def answer(self, data: bytes, limits: bytes = b"") -> bytes | None:
        """Return the answer to a request, with `limits` in the table's description; None if it is no request."""
        match data[:1]:
            case b"\x03":  # description of the table
                return data[:1] + len(self._items).to_bytes(2, "little") + self._crc.to_bytes(4, "little") + limits
            case b"\x02" if len(data) >= 3:  # description of an item
                number = int.from_bytes(data[1:3], "little")
                return data[:3] + self._items[number] if number < len(self._items) else data[:1]
            case _:
                return None
