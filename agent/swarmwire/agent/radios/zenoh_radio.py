"""The header of a packet on the robots' network: what an emulated packet needs not say, before the message.

    >>> PacketHeader(to=-1, sequence=7, sent_utc_ns=1_767_225_600_000_000_000).encode().hex()
    '01ffff070000000000faed51728618'

The sender stands in the key, where access control can see it; the message is encoded as in emulation.
"""

# pyright: reportUnknownMemberType=false

import math
import struct
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import zenoh
from zenoh.handlers import Callback

from swarmwire.agent.radios.radio import SENT, TOO_LARGE, NoRadioLog, RadioLog, ReceivedPacket, SentPacket
from swarmwire.agent.radios.tracker import Tracker
from swarmwire.comms.clock import DatedClock
from swarmwire.comms.errors import BadFrame
from swarmwire.comms.packets import (
    BROADCAST,
    NO_TX_STATUSES,
    TAG_BYTES,
    Payloads,
    ReceivedPackets,
    SentPackets,
    TxStatuses,
)
from swarmwire.comms.wire.radio_bridge import BoundedInbox, Pose
from swarmwire.comms.wire.robot_network import SwarmKeys

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


# --- A packet as it came from the robots' network, checked, with what was stamped on it when it arrived.


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


# --- What a robot's radio knows of its neighbours: how many of each one's packets arrived, and how many did not.


@dataclass(slots=True)
class LinkStatistics:
    """From one sender to this robot.

    Attributes:
        received: packets that arrived.
        missed: numbers that were left out before one that arrived.
        received_at_ns: when the last one arrived, by the robot's monotonic clock.
    """

    received: int = 0
    missed: int = 0
    received_at_ns: int = 0
    newest: int = -1  # highest number that the sender had used
    newest_utc_ns: int = 0  # when it sent that, by its own clock

    def add(self, sequence: int, sent_utc_ns: int, received_at_ns: int) -> None:
        """A packet arrived. One that was overtaken fills its gap; a sender that began anew counts from 0 again."""
        first = self.received == 0
        self.received += 1
        self.received_at_ns = received_at_ns
        if sequence > self.newest:
            self.missed += 0 if first else sequence - self.newest - 1
        elif sent_utc_ns <= self.newest_utc_ns:
            self.missed -= sequence < self.newest and self.missed > 0
            return
        self.newest, self.newest_utc_ns = sequence, sent_utc_ns

    @property
    def delivery(self) -> float:
        """Share of packets that arrived, 0 to 1, since the first one did; NaN before it."""
        return self.received / (self.received + self.missed) if self.received else float("nan")


# --- How far a sender is, and in which direction, from two poses that a tracker saw.


def range_bearing(own: Pose, sender: Pose) -> tuple[float, float]:
    """Distance in m and direction to the sender in the own frame, in (-pi, pi], positive to the left.

    >>> range_bearing(Pose(1.0, 1.0, math.pi / 2), Pose(-1.0, 1.0, 0.0))
    (2.0, 1.5707963267948966)
    """
    dx_m, dy_m = sender.x_m - own.x_m, sender.y_m - own.y_m
    turn_rad = math.remainder(math.atan2(dy_m, dx_m) - own.heading_rad, math.tau)
    return math.hypot(dx_m, dy_m), math.pi if turn_rad <= -math.pi else turn_rad


# --- The robots' own network as a radio: each packet is one message from peer to peer, and may be lost like any other.


# zenoh's stubs leave out the return types of put and undeclare.


MAX_WAITING = 1024  # packets that may wait for the agent's next step
MEASURES = ("range_m", "bearing_rad")  # with a tracker
NEEDS = ("radio.range", "radio.bearing")  # what these meet
NOWHERE = float("nan")


class ZenohRadio:
    """The radio of the robot `own` of the swarm `robots`.

    Attributes:
        links: from each sender that was received, by its index; for whoever asks how the network is.
    """

    def __init__(
        self,
        session: zenoh.Session,
        keys: SwarmKeys,
        robots: Sequence[str],
        own: str,
        max_payload_bytes: int,
        clock: DatedClock,
        tracker: Tracker | None = None,
        asks_pose: bool = False,
        log: RadioLog | None = None,
        say: Callable[[str], None] = lambda _: None,
    ) -> None:
        """`asks_pose`: the agent needs range or bearing, so packets from nowhere are not for it.

        The tracker is opened by its owner; `say` is told, once, what the user should know.
        """
        self._session, self._keys, self._clock, self._tracker = session, keys, clock, tracker
        self._own, self._asks_pose, self._say = own, asks_pose, say
        self._robots, self._row = tuple(robots), tuple(robots).index(own)
        self._sender_of = {robot: index for index, robot in enumerate(robots)}
        self._max_payload_bytes = max_payload_bytes
        self._log: RadioLog = log or NoRadioLog()
        self._inbox = BoundedInbox[Arrival](MAX_WAITING)
        self._subscriber: zenoh.Subscriber[None] | None = None
        self._publishers: dict[int, zenoh.Publisher] = {}  # by tag
        self._sequence = 0
        self._far_too_large = 0  # refused by the network's thread
        self._counted = Counter[str]()
        self.links: dict[int, LinkStatistics] = {}
        self.measures: tuple[str, ...] = MEASURES if tracker else ()
        self.needs: frozenset[str] = frozenset(NEEDS if tracker else ())

    def open(self) -> None:
        """Listen to everybody in the swarm."""
        self._subscriber = self._session.declare_subscriber(
            self._keys.any_radio, Callback(self._arrive, indirect=False), allowed_origin=zenoh.Locality.REMOTE
        )

    def received(self, now_ns: int) -> tuple[ReceivedPackets, TxStatuses]:
        """What arrived for the robot since the last call, each with its time and, with a tracker, range and bearing."""
        packets = [packet for arrival in self._inbox.take() if (packet := self._checked(arrival)) is not None]
        if not packets:
            return ReceivedPackets.none(self.measures), NO_TX_STATUSES
        packets.sort(key=_promised_order)
        given = [(packet, where) for packet in packets if (where := self._given(packet)) is not None]
        started_ns = self._clock.now_ns() - now_ns
        index = np.arange(len(given))
        columns = np.array([where for _, where in given], np.float64).reshape(len(given), 2).T
        received = ReceivedPackets(
            receiver=np.full(len(given), self._row),
            sender=np.array([packet.sender for packet, _ in given], np.int64),
            sequence=np.array([packet.header.sequence for packet, _ in given], np.int64),
            received_at_ns=np.array([packet.at_ns - started_ns for packet, _ in given], np.int64),
            given={name: np.ascontiguousarray(column) for name, column in zip(self.measures, columns, strict=False)},
            payload=index,
            payloads=Payloads.of([packet.message for packet, _ in given]),
        )
        return received, NO_TX_STATUSES

    def send(self, sent: SentPackets) -> None:
        """Put each packet into the network; too large ones and those for nobody are numbered, as in emulation."""
        for at, (to, tag, size_bytes) in enumerate(
            zip(sent.to.tolist(), sent.payloads.tags().tolist(), sent.payloads.sizes.tolist(), strict=True)
        ):
            sequence, self._sequence = self._sequence, (self._sequence + 1) % SEQUENCES
            utc_ns = self._clock.utc_ns()
            if size_bytes > self._max_payload_bytes:
                self._refuse_large(size_bytes)
                self._log.sent(SentPacket(utc_ns, sequence, to, size_bytes, tag, TOO_LARGE))
            elif to >= len(self._robots) or to == self._row or to < BROADCAST:
                self._counted["packets_to_nobody"] += 1
            else:
                self._put(tag, PacketHeader(to, sequence, utc_ns).encode() + sent.payloads.row(at))
                self._log.sent(SentPacket(utc_ns, sequence, to, size_bytes, tag, SENT))

    def counts(self) -> dict[str, int]:
        """What was sent, received and lost on the way, by name, where there is any."""
        counted = Counter(self._counted)
        counted["packets_oversized"] += self._far_too_large
        counted["packets_dropped"] += self._inbox.dropped
        return {name: count for name, count in sorted(counted.items()) if count}

    def close(self) -> None:
        """Hear and send no more; the session is its owner's."""
        declared = (self._subscriber, *self._publishers.values())
        self._subscriber, self._publishers = None, {}
        for one in declared:
            if one is not None and not self._session.is_closed():
                one.undeclare()

    def _arrive(self, sample: zenoh.Sample) -> None:
        """Called by the network's thread: it must take no time, and keep nothing that is large."""
        if len(sample.payload) > self._max_payload_bytes + HEADER_BYTES:
            self._far_too_large += 1
            return
        key, packet = str(sample.key_expr), sample.payload.to_bytes()
        self._inbox.put(Arrival(key, packet, self._clock.now_ns(), self._clock.utc_ns()))

    def _checked(self, arrival: Arrival) -> Arrived | None:
        """The packet that arrived, counted and noted for its link, or None if it is of no use."""
        sender = self._sender_of.get(sender_in(arrival.key))
        if sender is None or sender == self._row:
            self._counted["packets_of_unknown" if sender is None else "packets_in_own_name"] += 1
            return None
        try:
            packet = arrived(arrival, self._keys, sender, len(self._robots), self._max_payload_bytes)
        except BadFrame as error:
            self._counted[f"packets_{error.fault}"] += 1
            return None
        self.links.setdefault(sender, LinkStatistics()).add(
            packet.header.sequence, packet.header.sent_utc_ns, packet.at_ns
        )
        return packet

    def _given(self, packet: Arrived) -> tuple[float, float] | None:
        """Range and bearing of a packet that the agent gets, else None; the log learns of either."""
        where = self._where(packet.sender)
        mine = packet.header.to in (BROADCAST, self._row)
        given = mine and not (self._asks_pose and where is None)
        if not given:
            self._counted["packets_without_pose" if mine else "packets_overheard"] += 1
        else:
            self._counted["packets_received"] += 1
        received = ReceivedPacket(
            utc_ns=packet.utc_ns,
            sender=packet.sender,
            sequence=packet.header.sequence,
            to=packet.header.to,
            size_bytes=len(packet.message),
            tag=packet.tag,
            latency_ns=packet.utc_ns - packet.header.sent_utc_ns,
            distance_m=where[0] if where else None,
            given=given,
        )
        self._log.received(received)
        return (where or (NOWHERE, NOWHERE)) if given else None

    def _where(self, sender: int) -> tuple[float, float] | None:
        """Range and bearing of a sender, where a tracker saw both robots of late."""
        if self._tracker is None:
            return None
        now_utc_ns = self._clock.utc_ns()
        own = self._tracker.pose(self._own, now_utc_ns)
        its = self._tracker.pose(self._robots[sender], now_utc_ns)
        return range_bearing(own, its) if own and its else None

    def _refuse_large(self, size_bytes: int) -> None:
        self._counted["packets_too_large"] += 1
        if self._counted["packets_too_large"] == 1:
            self._say(
                f"radio: a message of {size_bytes} bytes is not sent: "
                f"expected at most {self._max_payload_bytes} (radio.max_payload_bytes)"
            )

    def _put(self, tag: int, packet: bytes) -> None:
        try:
            publisher = self._publishers.get(tag)
            if publisher is None:
                publisher = self._publishers[tag] = self._session.declare_publisher(
                    self._keys.radio(self._own, tag),
                    congestion_control=zenoh.CongestionControl.DROP,
                    allowed_destination=zenoh.Locality.REMOTE,
                )
            publisher.put(packet)
        except zenoh.ZError:  # the session was closed, or the network is not there any more
            self._counted["packets_refused"] += 1
        else:
            self._counted["packets_sent"] += 1


def _promised_order(packet: Arrived) -> tuple[int, int, int]:
    return packet.at_ns, packet.sender, packet.header.sequence
