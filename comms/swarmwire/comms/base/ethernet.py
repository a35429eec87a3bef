"""Ethernet frames as packets: addresses of robots, and the payload that carries a frame over the radio medium.

The payload is the frame with its two addresses exchanged, so its length is that of the frame. Its first two bytes are
equal for all robots' addresses, and are in the position of a message's tag.
"""

from swarmwire.comms.base.sentinels import BROADCAST

HEADER_BYTES = 14  # destination, source, type
ADDRESS_BYTES = 6
GROUP_BIT = 1  # bit of an address's first byte: broadcast and multicast
STATION_PREFIX = b"\x02SW"  # locally administered
LATE_S = 0.003  # wall time from reception by the modelled radio to delivery above which a frame counts as late
FRAME_TAG = int.from_bytes(STATION_PREFIX[:2], "little")  # tag of a payload that is a frame; no message has it


def station(robot: int) -> bytes:
    """Return the MAC address of the robot with this index in its arena: 02:53:57, then the index + 1.

    >>> station(0).hex(":")
    '02:53:57:00:00:01'
    """
    return STATION_PREFIX + (robot + 1).to_bytes(3, "big")


def exchanged(data: bytes) -> bytes:
    """Exchange the addresses: convert a frame to a payload, or a payload to a frame."""
    return data[ADDRESS_BYTES : 2 * ADDRESS_BYTES] + data[:ADDRESS_BYTES] + data[2 * ADDRESS_BYTES :]


def addressee(frame: bytes) -> int:
    """Return the index in its arena of the robot to which a frame is addressed; BROADCAST for a group address.

    For an address of no robot it is an index above those of all robots.
    """
    if frame[0] & GROUP_BIT:
        return BROADCAST
    if frame[:3] != STATION_PREFIX or frame[3:6] == b"\0\0\0":
        return 1 << 24
    return int.from_bytes(frame[3:6], "big") - 1
