"""The robots' own network as a radio: each packet is one zenoh message between peers, and may be lost.

The sender is part of the zenoh key, where access control can check it. A header precedes each message, with fields that
the emulation passes separately; the message itself is encoded as in emulation. With a tracker, range and bearing of a
sender are computed from the poses of both robots.
"""

# zenoh's stubs leave out the return types of put and undeclare.
# pyright: reportUnknownMemberType=false

import math
import struct
from collections import Counter
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import zenoh
from zenoh.handlers import Callback

from swarmwire.agent.radios.radio import SENT, TOO_LARGE, NoRadioLog, RadioLog, ReceivedPacket, SentPacket
from swarmwire.agent.radios.tracker import Tracker
from swarmwire.comms.base.angles import wrap_angle
from swarmwire.comms.base.clock import DatedClock
from swarmwire.comms.base.errors import BadFrame
from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.robot.packets import NO_TX_STATUSES, TAG_BYTES, Payloads, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.robot.tick_io import SparseTable
from swarmwire.comms.wire.keys import SwarmKeys
from swarmwire.comms.wire.radio_bridge import BoundedInbox, Pose

VERSION = 1
_LAYOUT = struct.Struct("<BhIq")  # version, to, sequence, sent_utc_ns
HEADER_BYTES = _LAYOUT.size
SEQUENCES = 2**32  # number of sequence numbers, after which a sender starts at 0 again
MAX_WAITING = 1024  # packets that may wait for the agent's next step
MEASURES = ("range_m", "bearing_rad")  # available with a tracker
NEEDS = ("radio.range", "radio.bearing")  # needs that MEASURES meet
UNKNOWN = float("nan")


class PacketHeader(NamedTuple):
    """The header before each message.

    >>> PacketHeader(to=-1, sequence=7, sent_utc_ns=1_767_225_600_000_000_000).encode().hex()
    '01ffff070000000000faed51728618'
    """

    to: int  # index of the addressed robot, or BROADCAST
    sequence: int  # number of packets that the sender sent before this one
    sent_utc_ns: int  # send time by the sender's clock

    def encode(self) -> bytes:
        """Encode the header."""
        return _LAYOUT.pack(VERSION, self.to, self.sequence % SEQUENCES, self.sent_utc_ns)

    @classmethod
    def decode(cls, packet: bytes) -> "PacketHeader":
        """Decode the header at the start of a packet; BadFrame ("malformed") if there is none."""
        if len(packet) < HEADER_BYTES:
            raise BadFrame("malformed", f"{len(packet)} bytes, expected {HEADER_BYTES} before the message")
        version, to, sequence, sent_utc_ns = _LAYOUT.unpack_from(packet)
        if version != VERSION or to < BROADCAST:
            raise BadFrame("malformed", f"version {version} to {to}, expected {VERSION} and {BROADCAST} or more")
        return cls(to, sequence, sent_utc_ns)


class Arrival(NamedTuple):
    """A packet in the inbox, not checked yet."""

    key: str
    packet: bytes  # header and message
    received_ns: int  # time of arrival by the robot's monotonic clock
    utc_ns: int


class CheckedPacket(NamedTuple):
    """A checked packet."""

    sender: int  # index in the swarm
    header: PacketHeader
    message: bytes  # encoded as in emulation, tag first
    tag: int
    received_ns: int  # time of arrival by the robot's monotonic clock
    utc_ns: int


def sender_in(key: str) -> str:
    """Return the sender in a packet's key, which is not checked and may contain wildcards."""
    return key.rpartition("/")[0].rpartition("/")[2]


def checked_packet(
    arrival: Arrival, keys: SwarmKeys, sender: int, robots: int, max_payload_bytes: int
) -> CheckedPacket:
    """Check a packet from a sender in a swarm of `robots` robots; BadFrame if it is malformed or too large."""
    header = PacketHeader.decode(arrival.packet)
    message = arrival.packet[HEADER_BYTES:]
    if len(message) > max_payload_bytes:
        raise BadFrame("oversized", f"{len(message)} bytes, expected at most {max_payload_bytes}")
    if len(message) < TAG_BYTES or header.to >= robots or header.to == sender:
        raise BadFrame("malformed", f"{len(message)} bytes to {header.to}")
    tag = int.from_bytes(message[:TAG_BYTES], "little")
    if arrival.key != keys.radio(sender_in(arrival.key), tag):
        raise BadFrame("malformed", f"a message {tag:04x} under {arrival.key}")
    return CheckedPacket(sender, header, message, tag, arrival.received_ns, arrival.utc_ns)


def range_bearing(receiver: Pose, sender: Pose) -> tuple[float, float]:
    """Return the sender's range in m and bearing in the receiver's frame, in (-pi, pi], positive to the left.

    >>> range_bearing(Pose(1.0, 1.0, math.pi / 2), Pose(-1.0, 1.0, 0.0))
    (2.0, 1.5707963267948966)
    """
    dx_m, dy_m = sender.x_m - receiver.x_m, sender.y_m - receiver.y_m
    return math.hypot(dx_m, dy_m), wrap_angle(math.atan2(dy_m, dx_m) - receiver.heading_rad)


class ZenohRadio:
    """The radio of `robot` in the swarm `robots`.

    Attributes:
        senders: indices of the robots from which a packet arrived.
    """

    def __init__(
        self,
        session: zenoh.Session,
        keys: SwarmKeys,
        robots: Sequence[str],
        robot: str,
        max_payload_bytes: int,
        clock: DatedClock,
        tracker: Tracker | None = None,
        needs_pose: bool = False,
        log: RadioLog | None = None,
        report: Callable[[str], None] = lambda _: None,
    ) -> None:
        """Keep the parameters; with `needs_pose` the agent gets no packet without range and bearing.

        The tracker is opened and closed by its owner; `report` gets a message for the user, once.
        """
        self._session, self._keys, self._clock, self._tracker = session, keys, clock, tracker
        self._robot, self._needs_pose, self._report = robot, needs_pose, report
        self._robots, self._row = tuple(robots), tuple(robots).index(robot)
        self._sender_of = {name: index for index, name in enumerate(robots)}
        self._max_payload_bytes = max_payload_bytes
        self._log: RadioLog = log or NoRadioLog()
        self._inbox = BoundedInbox[Arrival](MAX_WAITING)
        self._subscriber: zenoh.Subscriber[None] | None = None
        self._publishers: dict[int, zenoh.Publisher] = {}  # tag -> publisher
        self._sequence = 0
        self._oversized = 0  # packets refused in the network's thread
        self._counted = Counter[str]()
        self.senders: set[int] = set()
        self.measures: tuple[str, ...] = MEASURES if tracker else ()
        self.needs: frozenset[str] = frozenset(NEEDS if tracker else ())

    def open(self) -> None:
        """Subscribe to all robots of the swarm."""
        self._subscriber = self._session.declare_subscriber(
            self._keys.any_radio, Callback(self._arrive, indirect=False), allowed_origin=zenoh.Locality.REMOTE
        )

    def received(self, now_ns: int) -> tuple[ReceivedPackets, TxStatuses]:
        """Return packets for the robot since the last call; with a tracker, with range and bearing."""
        packets = [packet for arrival in self._inbox.pop_all() if (packet := self._checked(arrival)) is not None]
        if not packets:
            return ReceivedPackets.none(self.measures), NO_TX_STATUSES
        packets.sort(key=_order)
        located = [(packet, location) for packet in packets if (location := self._deliver(packet)) is not None]
        delivered = [packet for packet, _ in located]
        started_ns = self._clock.now_ns() - now_ns
        columns = np.array([location for _, location in located], np.float64).reshape(len(delivered), 2).T
        received = ReceivedPackets(
            receiver=np.full(len(delivered), self._row),
            sender_index=np.array([packet.sender for packet in delivered], np.int64),
            sequence=np.array([packet.header.sequence for packet in delivered], np.int64),
            received_at_ns=np.array([packet.received_ns - started_ns for packet in delivered], np.int64),
            measured={name: np.ascontiguousarray(column) for name, column in zip(self.measures, columns, strict=False)},
            payload=np.arange(len(delivered)),
            payloads=Payloads.from_rows([packet.message for packet in delivered]),
        )
        return received, NO_TX_STATUSES

    def note(self, states: SparseTable, values: SparseTable) -> None:
        """Do nothing: there is no world, and the robot's log has the notes."""

    def send(self, sent: SentPackets) -> None:
        """Publish each packet; too large ones and those without a receiver only consume a sequence number."""
        for i, (to, tag, size_bytes) in enumerate(
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
                self._put(tag, PacketHeader(to, sequence, utc_ns).encode() + sent.payloads.row(i))
                self._log.sent(SentPacket(utc_ns, sequence, to, size_bytes, tag, SENT))

    def counts(self) -> dict[str, int]:
        """Return the numbers of sent, received and lost packets, by name, without zeros."""
        counted = Counter(self._counted)
        counted["packets_oversized"] += self._oversized
        counted["packets_dropped"] += self._inbox.dropped
        return {name: count for name, count in sorted(counted.items()) if count}

    def close(self) -> None:
        """Stop receiving and sending; the session is closed by its owner."""
        declared = (self._subscriber, *self._publishers.values())
        self._subscriber, self._publishers = None, {}
        for declaration in declared:
            if declaration is not None and not self._session.is_closed():
                declaration.undeclare()

    def _arrive(self, sample: zenoh.Sample) -> None:
        """Queue a packet, without delay for the network's thread, which calls this; drop an oversized one."""
        if len(sample.payload) > self._max_payload_bytes + HEADER_BYTES:
            self._oversized += 1
            return
        key, packet = str(sample.key_expr), sample.payload.to_bytes()
        self._inbox.put(Arrival(key, packet, self._clock.now_ns(), self._clock.utc_ns()))

    def _checked(self, arrival: Arrival) -> CheckedPacket | None:
        """Return the packet of an arrival; None, and it is counted, if it is unusable."""
        sender = self._sender_of.get(sender_in(arrival.key))
        if sender is None or sender == self._row:
            self._counted["packets_of_unknown" if sender is None else "packets_in_own_name"] += 1
            return None
        try:
            packet = checked_packet(arrival, self._keys, sender, len(self._robots), self._max_payload_bytes)
        except BadFrame as error:
            self._counted[f"packets_{error.fault}"] += 1
            return None
        self.senders.add(sender)
        return packet

    def _deliver(self, packet: CheckedPacket) -> tuple[float, float] | None:
        """Log a packet; return its range and bearing, or None if the agent does not receive it."""
        location = self._locate(packet.sender)
        addressed = packet.header.to in (BROADCAST, self._row)
        delivered = addressed and not (self._needs_pose and location is None)
        if not delivered:
            self._counted["packets_without_pose" if addressed else "packets_overheard"] += 1
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
            distance_m=location[0] if location else None,
            delivered=delivered,
        )
        self._log.received(received)
        return (location or (UNKNOWN, UNKNOWN)) if delivered else None

    def _locate(self, sender: int) -> tuple[float, float] | None:
        """Return range and bearing of a sender; None without recent poses of both robots."""
        if self._tracker is None:
            return None
        now_utc_ns = self._clock.utc_ns()
        receiver_pose = self._tracker.pose(self._robot, now_utc_ns)
        sender_pose = self._tracker.pose(self._robots[sender], now_utc_ns)
        return range_bearing(receiver_pose, sender_pose) if receiver_pose and sender_pose else None

    def _refuse_large(self, size_bytes: int) -> None:
        self._counted["packets_too_large"] += 1
        if self._counted["packets_too_large"] == 1:
            self._report(
                f"radio: a message of {size_bytes} bytes is not sent: "
                f"expected at most {self._max_payload_bytes} (radio.max_payload_bytes)"
            )

    def _put(self, tag: int, packet: bytes) -> None:
        try:
            publisher = self._publishers.get(tag)
            if publisher is None:
                publisher = self._publishers[tag] = self._session.declare_publisher(
                    self._keys.radio(self._robot, tag),
                    congestion_control=zenoh.CongestionControl.DROP,
                    allowed_destination=zenoh.Locality.REMOTE,
                )
            publisher.put(packet)
        except zenoh.ZError:  # the session was closed, or the network is gone
            self._counted["packets_refused"] += 1
        else:
            self._counted["packets_sent"] += 1


def _order(packet: CheckedPacket) -> tuple[int, int, int]:
    """The order of packets in `ReceivedPackets`."""
    return packet.received_ns, packet.sender, packet.header.sequence
