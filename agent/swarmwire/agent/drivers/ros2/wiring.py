"""Keys of a base's topics, as bridges or rmw_zenoh have them, and a driver's part in the ROS graph."""

from typing import Any

import zenoh

from swarmwire.agent.drivers.ros2.feed import Feed
from swarmwire.agent.drivers.ros2.options import Ros2Options
from swarmwire.comms.robots.ros2.keys import READ, WRITE, RmwNode, absolute, bridge_key, rmw_key
from swarmwire.comms.robots.ros2.links import Inlet, Outlet
from swarmwire.comms.robots.ros2.messages import Messages

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
