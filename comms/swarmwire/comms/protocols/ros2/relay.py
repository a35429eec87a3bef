"""The relay of one robot: it cuts messages of its ROS 2 topics into packets, and puts those of others together.

All numbers are little-endian:

    part      tag, topic, number of the message, number of the part, number of parts; then the bytes of the part
    request   tag, topic + REQUEST, number of the message, first missing part; then a bit for each part from it on, the
              lowest first, 1 for a missing part; without bits: all parts

Best effort: a message with missing parts is lost as soon as a later one is complete. Reliable: once no packet of a
message has arrived for `retry_after_ns`, the receiver asks its sender for the missing parts, at most `retries` times;
the sender sends them to this receiver alone. A message of which no part arrived is missed once a later one is heard.
Reliable messages are delivered in order, so one that is given up delays the later ones.
"""

import struct
from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from swarmwire.comms.base.errors import BadFrame
from swarmwire.comms.robot.messages import RELAY_TAG

PART = struct.Struct("<HBIHH")
REQUEST_HEAD = struct.Struct("<HBIH")
REQUEST = 0x80  # added to the topic of a request
MAX_TOPICS, MAX_PARTS = REQUEST, 0xFFFF
MAX_MESSAGE_BYTES = 1 << 20
WINDOW = 4  # messages of a topic and sender that a receiver puts together, and that a sender keeps for requests


class RelayedTopic(NamedTuple):
    """The transport of a topic."""

    to: tuple[int, ...]  # indices of the robots that get it, or BROADCAST
    reliable: bool


class RelayedMessage(NamedTuple):
    """A message that arrived complete."""

    topic: int
    sender: int
    data: bytes


class RelayPacket(NamedTuple):
    """A packet for the radio."""

    to: int
    payload: bytes


@dataclass
class _Message:
    """A message that is put together."""

    heard_ns: int  # time of its last packet or request
    parts: list[bytes | None] = field(default_factory=list[bytes | None])  # empty: no part has arrived
    requests: int = 0
    is_lost: bool = False

    @property
    def is_complete(self) -> bool:
        return bool(self.parts) and None not in self.parts


class _Stream:
    """The messages of one sender on one topic, by number."""

    def __init__(self, first: int, *, reliable: bool) -> None:
        self._next, self._reliable = first, reliable  # number of the next message to deliver
        self.waiting: dict[int, _Message] = {}

    def add(self, number: int, part: int, parts: int, data: bytes, now_ns: int) -> list[bytes]:
        """Add a part; return the messages that are complete, in order."""
        if number < self._next:  # delivered or given up
            return []
        if self._reliable:
            for missed in range(max(self._next, number - WINDOW + 1), number):
                self.waiting.setdefault(missed, _Message(now_ns))
        message = self.waiting.setdefault(number, _Message(now_ns))
        message.parts = message.parts or [None] * parts
        if len(message.parts) != parts:
            raise BadFrame("malformed", f"message {number} has {len(message.parts)} parts, not {parts}")
        message.parts[part], message.heard_ns = data, now_ns
        complete = [number] if message.is_complete and not self._reliable else []
        return self.pop_up_to(max([number - WINDOW, *complete]))

    def pop_up_to(self, number: int = -1) -> list[bytes]:
        """Remove the messages up to this number, and later ones in order; return the complete ones."""
        complete: list[bytes] = []
        self._next = max(self._next, number + 1)
        for first in sorted(self.waiting):
            message = self.waiting[first]
            if first > number:
                if first != self._next or not (message.is_lost or message.is_complete):
                    break
                self._next = first + 1
            if message.is_complete:
                complete.append(b"".join(part or b"" for part in message.parts))
            del self.waiting[first]
        return complete


class RobotRelay:
    """The relay of one robot.

    Attributes:
        counts: numbers by what and topic: `messages` sent, `received`, `repeated` packets, `requests`; and malformed
            packets as ("malformed", -1).
    """

    def __init__(
        self, topics: Sequence[RelayedTopic], max_payload_bytes: int, retry_after_ns: int, retries: int
    ) -> None:
        """`max_payload_bytes` of the radio must exceed the header of a part."""
        self._topics: tuple[RelayedTopic, ...] = tuple(topics)
        self._retry_after_ns, self._retries = retry_after_ns, retries
        self._part_bytes = max_payload_bytes - PART.size
        self._request_bits = 8 * (max_payload_bytes - REQUEST_HEAD.size)
        self._numbers = [0] * len(topics)
        self._sent = [deque[tuple[int, list[bytes]]](maxlen=WINDOW) for _ in topics]
        self._streams: dict[tuple[int, int], _Stream] = {}  # by sender and topic
        self._packets: list[RelayPacket] = []
        self.counts = Counter[tuple[str, int]]()

    def send(self, topic: int, data: bytes) -> bool:
        """Cut a message into packets; False: it is too large, and is not sent."""
        cuts = range(0, max(len(data), 1), self._part_bytes)
        if len(data) > MAX_MESSAGE_BYTES or len(cuts) > MAX_PARTS:
            return False
        number = self._numbers[topic]
        self._numbers[topic] += 1
        packets = [
            PART.pack(RELAY_TAG, topic, number, part, len(cuts)) + data[start : start + self._part_bytes]
            for part, start in enumerate(cuts)
        ]
        self._packets += [RelayPacket(to, packet) for to in self._topics[topic].to for packet in packets]
        if self._topics[topic].reliable:
            self._sent[topic].append((number, packets))
        self.counts["messages", topic] += 1
        return True

    def receive(self, sender: int, payload: bytes, now_ns: int) -> list[RelayedMessage]:
        """Take a packet of the relay; return the messages that are complete with it."""
        try:
            return self._receive(sender, payload, now_ns)
        except (BadFrame, struct.error):
            self.counts["malformed", -1] += 1
            return []

    def follow(self, now_ns: int) -> list[RelayedMessage]:
        """Request missing parts that are due, and give up messages; return the messages that waited for these."""
        complete: list[RelayedMessage] = []
        for (sender, topic), stream in self._streams.items():
            if not (stream.waiting and self._topics[topic].reliable):
                continue
            for number, message in stream.waiting.items():
                if message.is_complete or now_ns - message.heard_ns < self._retry_after_ns:
                    continue
                if message.requests < self._retries:
                    message.requests, message.heard_ns = message.requests + 1, now_ns
                    self._packets.append(RelayPacket(sender, self._request(topic, number, message)))
                    self.counts["requests", topic] += 1
                else:
                    message.is_lost = True
            complete += self._received(topic, sender, stream.pop_up_to())
        return complete

    def pop_packets(self) -> list[RelayPacket]:
        """Remove and return the packets for the radio, in order."""
        packets, self._packets = self._packets, []
        return packets

    def _receive(self, sender: int, payload: bytes, now_ns: int) -> list[RelayedMessage]:
        head: tuple[int, ...] = REQUEST_HEAD.unpack_from(payload)
        _, topic, number, part = head
        if topic % REQUEST >= len(self._topics):
            raise BadFrame("malformed", f"topic {topic} of {len(self._topics)}")
        if topic >= REQUEST:
            self._repeat(sender, topic - REQUEST, number, part, payload[REQUEST_HEAD.size :])
            return []
        parts: int = PART.unpack_from(payload)[-1]
        if part >= parts or (parts - 1) * self._part_bytes > MAX_MESSAGE_BYTES:
            raise BadFrame("malformed", f"part {part} of {parts}")
        stream = self._streams.get((sender, topic))
        if stream is None:
            first = max(0, number - WINDOW + 1)
            stream = self._streams[sender, topic] = _Stream(first, reliable=self._topics[topic].reliable)
        return self._received(topic, sender, stream.add(number, part, parts, payload[PART.size :], now_ns))

    def _received(self, topic: int, sender: int, complete: list[bytes]) -> list[RelayedMessage]:
        self.counts["received", topic] += len(complete)
        return [RelayedMessage(topic, sender, data) for data in complete]

    def _request(self, topic: int, number: int, message: _Message) -> bytes:
        missing = [part for part, data in enumerate(message.parts) if data is None]
        first = missing[0] if missing else 0
        bits = sum(1 << (part - first) for part in missing if part - first < self._request_bits)
        head = REQUEST_HEAD.pack(RELAY_TAG, topic + REQUEST, number, first)
        return head + bits.to_bytes((bits.bit_length() + 7) // 8, "little")

    def _repeat(self, receiver: int, topic: int, number: int, first: int, bits: bytes) -> None:
        """Send the requested parts again, unless the message is no longer kept."""
        missing = int.from_bytes(bits, "little")
        for stored, packets in self._sent[topic]:
            if stored == number:
                repeated = [packet for part, packet in enumerate(packets[first:]) if not bits or missing >> part & 1]
                self._packets += [RelayPacket(receiver, packet) for packet in repeated]
                self.counts["repeated", topic] += len(repeated)
