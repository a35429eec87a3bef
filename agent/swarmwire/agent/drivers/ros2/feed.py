"""Topics of a ROS 2 base in a zenoh session: `Feed` buffers the messages of one, `SessionTopics` declares them all.

Keys are those of zenoh-bridge-ros2dds or of rmw_zenoh; with the latter, the driver also takes part in the ROS graph.
"""

from collections import deque
from typing import Any

import zenoh

from swarmwire.agent.drivers.ros2.topics import Fields, Reader, Ros2Options
from swarmwire.comms.base.clock import Clock
from swarmwire.comms.base.errors import BadFrame
from swarmwire.comms.protocols.ros2.keys import READ, WRITE, RmwNode, absolute, bridge_key, rmw_key
from swarmwire.comms.protocols.ros2.links import Publisher, Subscription
from swarmwire.comms.protocols.ros2.messages import Messages

NODE = "swarmwire_driver"


class Feed:
    """Buffers the newest payloads of one topic, from any thread, and decodes them in the thread that calls `read`.

    Attributes:
        sensors: the sensors that read this topic.
        garbage: malformed payloads so far.
    """

    def __init__(self, reader: Reader, messages: Messages, clock: Clock) -> None:
        self.sensors = frozenset(field.split(".")[0] for field in reader.fields)
        self.garbage = 0
        self._reader, self._messages, self._clock = reader, messages, clock
        self._waiting: deque[tuple[int, bytes]] = deque(maxlen=reader.keeps)
        self._received_ns: int | None = None  # time of the newest valid message

    def put(self, payload: bytes) -> None:
        """Buffer a payload that has arrived."""
        self._waiting.append((self._clock.now_ns(), payload))

    @property
    def is_blind(self) -> bool:
        """True if a topic that bases publish all the time has had no valid message since the connection."""
        return self._reader.is_steady and self._received_ns is None

    def begin(self) -> None:
        """Start a new connection: drop earlier messages."""
        self._waiting.clear()
        self._received_ns = None

    def read(self) -> Fields:
        """Decode the buffered payloads, and return the newest readings."""
        while self._waiting:
            arrived_ns, payload = self._waiting.popleft()
            try:
                self._reader.read(self._messages.decode(self._reader.kind, payload))
                self._received_ns = arrived_ns
            except BadFrame:
                self.garbage += 1
        return self._reader.fields

    def silent_ns(self, now_ns: int, since_ns: int) -> int:
        """Return the time since the last valid message, or since `since_ns`; 0 for a topic that may be silent."""
        if not self._reader.is_steady:
            return 0
        return now_ns - (since_ns if self._received_ns is None else self._received_ns)


class SessionTopics:
    """Declares topics in one session, each under its full name.

    Attributes:
        refused: messages so far without rmw_zenoh's attachment.
    """

    def __init__(self, session: zenoh.Session, namespace: str, options: Ros2Options, messages: Messages) -> None:
        self.refused = 0
        self._session, self._namespace, self._messages = session, namespace, messages
        self._node: RmwNode | None = None
        self._tokens: list[Any] = []  # zenoh undeclares a token with its last reference
        if options.transport == "rmw":
            full = absolute("/", namespace.strip("/"))
            self._node = RmwNode(options.domain, str(session.zid()), 0, full, NODE)
            self._tokens.append(session.liveliness().declare_token(self._node.token))

    def publisher(self, topic: str, kind: str) -> Publisher:
        """Declare a topic for messages of this kind, and return its publisher."""
        full = absolute(self._namespace, topic)
        if self._node is None:
            return Publisher(self._session, bridge_key(full), None)
        token = self._declare(self._node, WRITE, full, kind)
        return Publisher(self._session, rmw_key(self._node.domain, full, kind, self._messages.hash_of(kind)), token)

    def subscribe(self, topic: str, kind: str, feed: Feed) -> None:
        """Subscribe to a topic with messages of this kind, of any type hash."""
        full = absolute(self._namespace, topic)
        if self._node is not None:
            self._declare(self._node, READ, full, kind)
        key = bridge_key(full) if self._node is None else rmw_key(self._node.domain, full, kind)
        Subscription(self._session, key, attached=self._node is not None, on_payload=feed.put, on_fault=self._refuse)

    def _declare(self, node: RmwNode, direction: str, topic: str, kind: str) -> str:
        token = node.topic_token(len(self._tokens), direction, topic, kind, self._messages.hash_of(kind))
        self._tokens.append(self._session.liveliness().declare_token(token))
        return token

    def _refuse(self, fault: str) -> None:
        self.refused += 1
