"""A packet as it came from the robots' network, checked, with what was stamped on it when it arrived."""

from typing import NamedTuple

from swarmwire.agent.radios.packet_header import HEADER_BYTES, PacketHeader
from swarmwire.comms.errors import BadFrame
from swarmwire.comms.packets import TAG_BYTES
from swarmwire.comms.wire.robot_network import SwarmKeys


class Arrival(NamedTuple):
    """What the network's thread puts in the inbox."""

    key: str
    packet: bytes  # header and message
    at_ns: int  # when it arrived, by the robot's monotonic clock
    utc_ns: int


class Arrived(NamedTuple):
    """One packet."""

    sender: int  # index in the swarm
    header: PacketHeader
    message: bytes  # as encoded in emulation, tag first
    tag: int
    at_ns: int
    utc_ns: int


def sender_in(key: str) -> str:
    """The robot that a packet's key names, if it is one; it may still be of another form, with wildcards."""
    return key.rpartition("/")[0].rpartition("/")[2]


def arrived(arrival: Arrival, keys: SwarmKeys, sender: int, robots: int, max_payload_bytes: int) -> Arrived:
    """The packet of a sender among so many robots; BadFrame if it breaks the protocol, or is too large for it."""
    header = PacketHeader.decode(arrival.packet)
    message = arrival.packet[HEADER_BYTES:]
    if len(message) > max_payload_bytes:
        raise BadFrame("oversized", f"{len(message)} bytes, expected at most {max_payload_bytes}")
    if len(message) < TAG_BYTES or header.to >= robots or header.to == sender:
        raise BadFrame("malformed", f"{len(message)} bytes to {header.to}")
    tag = int.from_bytes(message[:TAG_BYTES], "little")
    if arrival.key != keys.radio(sender_in(arrival.key), tag):
        raise BadFrame("malformed", f"a message {tag:04x} under {arrival.key}")
    return Arrived(sender, header, message, tag, arrival.at_ns, arrival.utc_ns)
