"""The radio of robots as topics of ROS 2: bytes on `radio/tx` and `radio/rx`, and topics that other robots receive.

`RosRadio` is at the medium as `PacketPorts`: messages of nodes become packets of their robot, and received packets
become messages. It subscribes to exact names only, none of which it publishes to, so nothing is relayed twice.
"""

from collections import Counter, defaultdict
from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from typing import Any

import numpy as np
import zenoh

from swarmwire.comms.base.clock import DatedClock, to_ns
from swarmwire.comms.base.config import folder_of
from swarmwire.comms.base.errors import BadFrame, BadInput
from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.protocols.ros2.keys import (
    BYTES,
    DEFAULT_QOS,
    RADIO_TOPICS,
    READ,
    WRITE,
    Qos,
    RmwNode,
    absolute,
    bridge_key,
    bridge_token,
    rmw_key,
    ros_name,
)
from swarmwire.comms.protocols.ros2.links import Publisher, Subscription, UndeclaredPublisher
from swarmwire.comms.protocols.ros2.messages import Messages
from swarmwire.comms.protocols.ros2.relay import (
    MAX_MESSAGE_BYTES,
    REQUEST,
    RelayedMessage,
    RelayedTopic,
    RelayPacket,
    RobotRelay,
)
from swarmwire.comms.robot.messages import RELAY_TAG, RESERVED_TAGS
from swarmwire.comms.robot.packets import Payloads, ReceivedPackets, SentPackets
from swarmwire.comms.wire.radio_bridge import BoundedInbox
from swarmwire.world.gateways.ros2.relay_report import RelayReport, SentCounts, relay_report
from swarmwire.world.scenario.scenario import Scenario

RADIO_NODE = "radio"
TX, RX = f"{RADIO_TOPICS}tx", f"{RADIO_TOPICS}rx"
MAX_WAITING = 256  # messages of nodes that wait for the loop
MAX_RECEIVED_TOPICS = 2000  # the declaration of a token takes longer the more there are: 2,000 take some seconds
FOLLOWS = 4  # looks for missing parts in the time after which they are requested
LATCHED = Qos(depth=1, latched=True)


class RosRadio:
    """The topics on the radio of all robots that have topics."""

    tag = RELAY_TAG

    def __init__(
        self, scenario: Scenario, names: Sequence[str], namespaces: Mapping[int, str], clock: DatedClock
    ) -> None:
        """`names` are those of all robots; `namespaces` has, by row, those of robots with topics.

        BadInput for too many topics, or receivers without topics.
        """
        assert scenario.radio
        self._source, self._table, self._clock = scenario.source, scenario.ros2.relay, clock
        self._names, rows = tuple(names), sorted(namespaces)
        self._ros_names = [namespaces.get(row, ros_name(name)).strip("/") for row, name in enumerate(names)]
        self._row_of = {name: row for kind in (self._names, self._ros_names) for row, name in enumerate(kind)}
        retry_after_ns, groups = to_ns(self._table.retry_after_s), scenario.groups()
        self._receivers = [
            {row for name in topic.to for row in groups.get(name) or (self._row_of[name],)} or set(rows)
            for topic in self._table.topics
        ]
        for index, receivers in enumerate(self._receivers):
            if others := sorted(receivers - namespaces.keys()):
                expected = f"expected robots that have topics: {self._names[others[0]]} has none"
                raise BadInput(scenario.source, f"ros2.relay.topics.{index}.to", expected)
        received = sum(len(rows) - 1 for receivers in self._receivers for row in rows if row in receivers)
        if received > MAX_RECEIVED_TOPICS:
            expected = f"expected at most {MAX_RECEIVED_TOPICS} received topics, one for each receiver and sender"
            raise BadInput(scenario.source, "ros2.relay.topics", f"{expected}, got {received}: `to` lowers them")
        self._relays: dict[int, RobotRelay] = {}
        for row in rows:
            to = [tuple(sorted(receivers - {row})) for receivers in self._receivers]
            topics = [
                RelayedTopic(receivers if topic.to else (BROADCAST,), topic.reliable)
                for topic, receivers in zip(self._table.topics, to, strict=True)
            ]
            self._relays[row] = RobotRelay(
                topics, scenario.radio.max_payload_bytes, retry_after_ns, self._table.retries
            )
        self._messages: dict[int, Messages] = {}  # by row
        self._publishers = defaultdict[tuple[int, str], list[Publisher | UndeclaredPublisher]](list)  # by row and topic
        self._declared: list[object] = []  # zenoh undeclares unreferenced ones
        self._inbox = BoundedInbox[Callable[[], None]](MAX_WAITING)
        self._packets: dict[int, list[RelayPacket]] = {}  # by row: packets of `radio/tx`
        self._counts, self._sent = Counter[str](), SentCounts()
        self._follow_ns, self._follow_after_ns = 0, retry_after_ns // FOLLOWS

    def prepare(self, messages: Messages) -> None:
        """Add the definitions of the topics' types to these messages; BadInput for a type that stays unknown."""
        for index, topic in enumerate(self._table.topics):
            key = f"ros2.relay.topics.{index}"
            if topic.definition and not messages.has(topic.type):
                try:
                    messages.add(topic.type, (folder_of(self._source) / topic.definition).read_text(encoding="utf-8"))
                except (OSError, ValueError, BadFrame) as error:
                    raise BadInput(
                        self._source, f"{key}.definition", f"expected the type's .msg file: {error}"
                    ) from None
            if not messages.has(topic.type):
                expected = f"expected a type of ROS 2 {messages.distro} that rosbags knows, or its `definition`"
                raise BadInput(self._source, f"{key}.type", f"{expected}, got {topic.type!r}")

    def join(
        self, row: int, session: zenoh.Session, node: RmwNode, messages: Messages, *, is_rmw: Sequence[bool]
    ) -> None:
        """Offer the topics of a robot on a session, as `node`; safe to call from any thread.

        `is_rmw` has True for rmw_zenoh and False for a bridge; `messages` are prepared.
        """
        self._messages[row] = messages
        topics = [(READ, TX, BYTES, DEFAULT_QOS, partial(self._transmit, row))]
        topics += [(WRITE, RX, BYTES, DEFAULT_QOS, None)]
        for index, topic in enumerate(self._table.topics):
            topics.append((READ, topic.name, topic.type, DEFAULT_QOS, partial(self._relay, row, index)))
            qos = LATCHED if topic.latched else DEFAULT_QOS
            if row in self._receivers[index]:
                senders = (sender for sender in self._relays if sender != row)
                topics += [(WRITE, self._received_name(sender, index), topic.type, qos, None) for sender in senders]
        tokens = [node.token] if True in is_rmw else []
        for number, (way, name, kind, qos, accept) in enumerate(topics, start=1):
            full, type_hash = absolute(node.namespace, name), messages.hash_of(kind)
            for rmw in is_rmw:
                endpoint = way, full, kind, type_hash, qos
                token = node.topic_token(number, *endpoint) if rmw else bridge_token(node.zid, *endpoint)
                key = rmw_key(node.domain, full, kind, type_hash if way == WRITE else "*") if rmw else bridge_key(full)
                rmw_token = token if rmw else None
                if accept:
                    self._declared.append(self._subscribe(session, key, accept, attached=rmw))
                elif name == RX or qos.latched:
                    self._publishers[row, name].append(Publisher(session, key, rmw_token, qos))
                else:
                    self._publishers[row, name].append(UndeclaredPublisher(session, key, rmw_token))
                tokens.append(token)
        self._declared += [session.liveliness().declare_token(token) for token in tokens]

    def deliver(self, received: ReceivedPackets) -> ReceivedPackets:
        """See `PacketPorts`: publish complete messages on the receivers' topics, and other packets on `radio/rx`."""
        now_ns = self._clock.now_ns()
        if now_ns >= self._follow_ns:
            self._follow_ns = now_ns + self._follow_after_ns
            for row, relay in self._relays.items():
                self._publish_messages(row, relay.follow(now_ns))
        if not len(received):
            return received
        is_relay = received.payloads.tags()[received.payload] == RELAY_TAG
        data = cache(received.payloads.row)  # receivers share the bytes of a packet
        for index in np.flatnonzero(is_relay).tolist():
            row = int(received.receiver[index])
            if row in self._relays:
                sender, payload = int(received.sender_index[index]), data(int(received.payload[index]))
                self._publish_messages(row, self._relays[row].receive(sender, payload, now_ns))
        others = received.select(np.flatnonzero(~is_relay)) if is_relay.any() else received
        if listening := [row for row in self._relays if self._has_subscribers(row, RX)]:
            for index in np.flatnonzero(np.isin(others.receiver, listening)).tolist():
                payload = self._received_bytes(others, index, data(int(others.payload[index])))
                self._publish(int(others.receiver[index]), RX, payload)
        return others

    def pop_packets(self) -> list[SentPackets]:
        """See `PacketPorts`."""
        for take in self._inbox.pop_all():
            take()
        packets, self._packets = self._packets, {}
        for row, relay in self._relays.items():
            if relayed := relay.pop_packets():
                packets.setdefault(row, []).extend(relayed)
        return [
            SentPackets(
                np.full(len(queued), row),
                np.array([packet.to for packet in queued]),
                Payloads.from_rows([packet.payload for packet in queued]),
            )
            for row, queued in sorted(packets.items())
        ]

    def count_sent(self, packets: SentPackets) -> None:
        """See `PacketPorts`: count packets and bytes by robot and topic."""
        tags = packets.payloads.tags()
        for index in np.flatnonzero(tags == RELAY_TAG).tolist():
            payload, row = packets.payloads.row(index), int(packets.sender[index])
            topic = payload[2] % REQUEST
            self._sent["packets", row, topic] += 1
            self._sent["bytes", row, topic] += len(payload)

    def counts(self) -> dict[str, int]:
        """See `PacketPorts`."""
        counts = Counter(self._counts)
        counts["ros2_radio_dropped"] += self._inbox.dropped
        counts["ros2_radio_malformed"] += sum(relay.counts["malformed", -1] for relay in self._relays.values())
        return {name: count for name, count in sorted(counts.items()) if count}

    def report(self) -> tuple[RelayReport, ...]:
        """Return the report on each relayed topic so far."""
        return tuple(
            relay_report(topic, index, self._names, self._relays, self._receivers[index], self._sent)
            for index, topic in enumerate(self._table.topics)
        )

    def _received_name(self, sender: int, topic: int) -> str:
        """Return the name under which receivers get the topic of a sender."""
        return f"{RADIO_TOPICS}{self._ros_names[sender]}/{self._table.topics[topic].name}"

    def _subscribe(self, session: zenoh.Session, key: str, take: Callable[[bytes], None], *, attached: bool) -> object:
        """Queue messages for the loop, with what takes them; the network's threads call the subscriber."""
        return Subscription(
            session,
            key,
            attached=attached,
            on_payload=partial(self._accept, take),
            on_fault=self._count,
        )

    def _accept(self, take: Callable[[bytes], None], payload: bytes) -> None:
        if len(payload) > MAX_MESSAGE_BYTES:
            self._count("too_large")
        else:
            self._inbox.put(partial(take, payload))

    def _count(self, fault: str) -> None:
        self._counts[f"ros2_radio_{fault}"] += 1

    def _relay(self, row: int, topic: int, payload: bytes) -> None:
        if not self._relays[row].send(topic, payload):
            self._count("too_large")

    def _transmit(self, row: int, payload: bytes) -> None:
        """Send the bytes of a message on `radio/tx`, to the robot that its first dimension names, or to all."""
        try:
            message = self._messages[row].decode(BYTES, payload)
        except BadFrame as error:
            self._count(error.fault)
            return
        data, names = message.data.tobytes(), [dimension.label for dimension in message.layout.dim]
        to = BROADCAST if not names or not names[0] else self._row_of.get(names[0])
        if to is None:
            self._count("to_unknown")
        elif not data or int.from_bytes(data[:2], "little") in RESERVED_TAGS:
            self._count("malformed")
        else:
            self._packets.setdefault(row, []).append(RelayPacket(to, data))

    def _received_bytes(self, received: ReceivedPackets, index: int, data: bytes) -> bytes:
        """Return a message of a received packet: its bytes, and the sender and measurements as names of dimensions."""
        messages = self._messages[int(received.receiver[index])]
        labels = [self._ros_names[int(received.sender_index[index])]]
        labels += [f"{name}={column[index]:.9g}" for name, column in received.measured.items()]
        dimensions: list[Any] = [
            messages.make("std_msgs/msg/MultiArrayDimension", label, size, size)
            for label, size in zip(labels, (len(data), *(1 for _ in labels[1:])), strict=True)
        ]
        layout = messages.make("std_msgs/msg/MultiArrayLayout", dimensions, 0)
        return messages.encode(BYTES, messages.make(BYTES, layout, np.frombuffer(data, np.uint8)))

    def _publish_messages(self, row: int, messages: Sequence[RelayedMessage]) -> None:
        for message in messages:
            self._publish(row, self._received_name(message.sender, message.topic), message.data)

    def _has_subscribers(self, row: int, topic: str) -> bool:
        return any(publisher.has_subscribers for publisher in self._publishers.get((row, topic), ()))

    def _publish(self, row: int, topic: str, payload: bytes) -> None:
        utc_ns = self._clock.utc_ns()
        for publisher in self._publishers.get((row, topic), ()):
            if publisher.has_subscribers:
                publisher.put(payload, utc_ns)
