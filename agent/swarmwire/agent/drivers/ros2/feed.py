"""One topic of the base as it comes in: messages wait here until the agent looks."""

from collections import deque
from typing import Any

import zenoh

from swarmwire.agent.drivers.ros2.topics import Fields, Reader, Ros2Options
from swarmwire.comms.clock import Clock
from swarmwire.comms.errors import BadFrame
from swarmwire.comms.robots.ros2.keys import READ, WRITE, RmwNode, absolute, bridge_key, rmw_key
from swarmwire.comms.robots.ros2.links import Inlet, Outlet
from swarmwire.comms.robots.ros2.messages import Messages


class Feed:
    """Keeps the newest payloads, from whatever thread they come, and reads them where `look` is called.

    Attributes:
        senses: what the topic tells of.
        garbage: how many payloads were no messages.
    """

    def __init__(self, reader: Reader, messages: Messages, clock: Clock) -> None:
        self.sensors = frozenset(field.split(".")[0] for field in reader.fields)
        self.garbage = 0
        self._reader, self._messages, self._clock = reader, messages, clock
        self._waiting: deque[tuple[int, bytes]] = deque(maxlen=reader.keeps)
        self._received_ns: int | None = None  # when the newest message that could be read came

    def take(self, payload: bytes) -> None:
        """A payload came."""
        self._waiting.append((self._clock.now_ns(), payload))

    @property
    def is_blind(self) -> bool:
        """Whether nothing could be read since the connection was made, on a topic that a base tells all the time."""
        return self._reader.is_steady and self._received_ns is None

    def begin(self) -> None:
        """A new connection: what came before does not count as received."""
        self._waiting.clear()
        self._received_ns = None

    def look(self) -> Fields:
        """The newest readings."""
        while self._waiting:
            came_ns, payload = self._waiting.popleft()
            try:
                self._reader.read(self._messages.decode(self._reader.kind, payload))
                self._received_ns = came_ns
            except BadFrame:
                self.garbage += 1
        return self._reader.fields

    def silent_ns(self, now_ns: int, since_ns: int) -> int:
        """For how long nothing came that could be read, since `since_ns` at most; 0 if that is no fault."""
        if not self._reader.is_steady:
            return 0
        return now_ns - (since_ns if self._received_ns is None else self._received_ns)


# --- Keys of a base's topics, as bridges or rmw_zenoh have them, and a driver's part in the ROS graph.


NODE = "swarmwire_driver"


class Wiring:
    """Declares topics in one session, each under its full name.

    Attributes:
        refused: messages that came without rmw_zenoh's attachment.
    """

    def __init__(self, session: zenoh.Session, namespace: str, options: Ros2Options, messages: Messages) -> None:
        self.refused = 0
        self._session, self._namespace, self._messages = session, namespace, messages
        self._node: RmwNode | None = None
        self._tokens: list[Any] = []  # undeclared when they are forgotten
        if options.transport == "rmw":
            full = absolute("/", namespace.strip("/"))
            self._node = RmwNode(options.domain, str(session.zid()), 0, full, NODE)
            self._tokens.append(session.liveliness().declare_token(self._node.token))

    def outlet(self, topic: str, kind: str) -> Outlet:
        """Where messages of this kind go out."""
        full = absolute(self._namespace, topic)
        if self._node is None:
            return Outlet(self._session, bridge_key(full), None)
        token = self._declare(self._node, WRITE, full, kind)
        return Outlet(self._session, rmw_key(self._node.domain, full, kind, self._messages.hash_of(kind)), token)

    def feed(self, topic: str, kind: str, feed: Feed) -> None:
        """Let messages of this kind come in, of whatever hash."""
        full = absolute(self._namespace, topic)
        if self._node is not None:
            self._declare(self._node, READ, full, kind)
        key = bridge_key(full) if self._node is None else rmw_key(self._node.domain, full, kind)
        Inlet(self._session, key, attached=self._node is not None, take=feed.take, refuse=self._refuse)

    def _declare(self, node: RmwNode, direction: str, topic: str, kind: str) -> str:
        token = node.topic_token(len(self._tokens), direction, topic, kind, self._messages.hash_of(kind))
        self._tokens.append(self._session.liveliness().declare_token(token))
        return token

    def _refuse(self, fault: str) -> None:
        self.refused += 1
