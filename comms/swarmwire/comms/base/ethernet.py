"""Ethernet frames as packets: the robots' addresses, and the payload that carries a frame over the radio medium.

The payload is the frame with its two addresses exchanged: it has the frame's exact length, and its first two bytes,
those of every robot's own address, stand where a message has its tag.
"""

from swarmwire.comms.base.sentinels import BROADCAST

HEADER_BYTES = 14  # destination, source, type
ADDRESS_BYTES = 6
GROUP_BIT = 1  # of an address's first byte: broadcast and multicast
STATION_PREFIX = b"\x02SW"  # locally administered
LATE_S = 0.003  # wall time after its reception by the modelled radio from which a delivered frame counts as late
FRAME_TAG = int.from_bytes(STATION_PREFIX[:2], "little")  # of payloads that are frames; no message has this tag


def station(robot: int) -> bytes:
    """The MAC address of the robot with this index in its arena: 02:53:57, then the index + 1.

    >>> station(0).hex(":")
    '02:53:57:00:00:01'
    """
    return STATION_PREFIX + (robot + 1).to_bytes(3, "big")


def exchanged(data: bytes) -> bytes:
    """The payload of a frame, or the frame of a payload."""
    return data[ADDRESS_BYTES : 2 * ADDRESS_BYTES] + data[:ADDRESS_BYTES] + data[2 * ADDRESS_BYTES :]


def addressee(frame: bytes) -> int:
    """The index in its arena of the robot to which a frame is addressed; BROADCAST for a group address.

    An address that is no robot's becomes an index beyond all robots.
    """
    if frame[0] & GROUP_BIT:
        return BROADCAST
    if frame[:3] != STATION_PREFIX or frame[3:6] == b"\0\0\0":
        return 1 << 24
    return int.from_bytes(frame[3:6], "big") - 1
