"""zenoh sessions and topics of ROS 2 links: a gateway is a router, as in ROS 2, and a driver is a client of one.

`Subscription` subscribes to a topic and `Publisher` publishes to one, each with or without rmw_zenoh's attachment.
"""

# pyright: reportUnknownMemberType=false

import json
import re
from collections.abc import Callable
from typing import Any

import zenoh
from zenoh.ext import CacheConfig, declare_advanced_publisher

from swarmwire.comms.base.errors import BadFrame, BadInput
from swarmwire.comms.protocols.ros2.keys import DEFAULT_QOS, Qos, attachment, check_attachment, publisher_id
from swarmwire.comms.wire.sessions import close_session

ENDPOINT = re.compile(r"(tcp|udp|ws)/.+:\d+|unixsock-stream/.+")
EXAMPLE = "tcp/192.168.1.7:7447"
LEASE_MS = 2000  # time after which an unreachable peer is noticed
CLOSE_TIMEOUT_S = 10.0  # zenoh's time-out for a robot's last command, which may still be on its way


def check_endpoint(endpoint: str, where: str, key: str) -> None:
    """Raise BadInput with `where` and `key` unless this is an endpoint of zenoh."""
    if not ENDPOINT.fullmatch(endpoint):
        raise BadInput(where, key, f"expected an endpoint of zenoh such as {EXAMPLE}, got {endpoint!r}")


def open_router(endpoint: str) -> tuple[zenoh.Session, str]:
    """Open a router that listens on `endpoint`; return it with its actual endpoint. zenoh.ZError if it is taken.

    It gossips, as rmw_zenoh's router does, since nodes find one another through it.
    """
    sections: dict[str, object] = {
        "listen": {"endpoints": [endpoint]},
        "adminspace": {"enabled": True, "permissions": {"read": True, "write": False}},  # reports the port
    }
    session = zenoh.open(_config("router", sections, gossip=True))
    for reply in session.get(f"@/{session.zid()}/router", timeout=2.0):
        if reply.ok is not None:
            return session, json.loads(reply.ok.payload.to_string())["locators"][0]
    return session, endpoint


def open_client(endpoint: str, connect_s: float) -> zenoh.Session:
    """Open a client of the router at `endpoint`, trying for `connect_s`; zenoh.ZError if there is no answer."""
    connect = {
        "endpoints": [endpoint],
        "timeout_ms": round(connect_s * 1000),
        "retry": {"period_init_ms": 50, "period_max_ms": 500, "period_increase_factor": 1.5},
    }
    return zenoh.open(_config("client", {"connect": connect}, gossip=False))


def close(session: zenoh.Session) -> None:
    """Close a session; earlier puts still go out."""
    close_session(session, CLOSE_TIMEOUT_S)


def is_linked(session: zenoh.Session) -> bool:
    """Return True if a client is connected to its router."""
    return bool(session.info.routers_zid() or session.info.peers_zid())


def _config(mode: str, sections: dict[str, object], *, gossip: bool) -> zenoh.Config:
    return zenoh.Config.from_json5(
        json.dumps(
            {
                "mode": mode,
                "scouting": {"delay": 0, "multicast": {"enabled": False}, "gossip": {"enabled": gossip}},
                "transport": {"shared_memory": {"enabled": False}, "link": {"tx": {"lease": LEASE_MS}}},
                **sections,
            }
        )
    )


class Subscription:
    """A subscriber on one key."""

    def __init__(
        self,
        session: zenoh.Session,
        key: str,
        *,
        attached: bool,
        on_payload: Callable[[bytes], None],
        on_fault: Callable[[str], None],
    ) -> None:
        """Subscribe to a key.

        Args:
            session: the session.
            key: the key expression.
            attached: True if messages have rmw_zenoh's attachment.
            on_payload: called with each payload in the network's thread, so it must return at once.
            on_fault: called with the fault of a message without a valid attachment.
        """
        self._attached, self._on_payload, self._on_fault = attached, on_payload, on_fault
        self._subscriber: Any = session.declare_subscriber(key, zenoh.handlers.Callback(self._receive, indirect=False))

    def close(self) -> None:
        """End the subscription."""
        self._subscriber.undeclare()

    def _receive(self, sample: zenoh.Sample) -> None:
        if self._attached:
            try:
                check_attachment(None if sample.attachment is None else sample.attachment.to_bytes())
            except BadFrame as error:
                self._on_fault(error.fault)
                return
        self._on_payload(sample.payload.to_bytes())


class UndeclaredPublisher:
    """A publisher that the network does not know of: it costs nothing until it sends, as befits one of thousands.

    Attributes:
        has_subscribers: always True.
    """

    def __init__(self, session: zenoh.Session, key: str, token: str | None) -> None:
        """See `Publisher`."""
        self._session, self._key = session, key
        self._id = None if token is None else publisher_id(token)
        self._sequence, self.has_subscribers = 0, True

    def put(self, payload: bytes, utc_ns: int) -> None:
        """See `Publisher.put`."""
        self._sequence += 1
        attached = None if self._id is None else attachment(self._sequence, utc_ns, self._id)
        drop = zenoh.CongestionControl.DROP
        self._session.put(self._key, payload, congestion_control=drop, attachment=attached)


class Publisher:
    """A publisher on one key. Payloads are dropped if the network cannot keep up.

    Attributes:
        has_subscribers: True if the key has a subscriber, or may get a later one that requests the last messages. The
            network's thread updates it, since a query would cost 1 to 20 us, and a gateway has hundreds of publishers.
    """

    def __init__(self, session: zenoh.Session, key: str, token: str | None, qos: Qos = DEFAULT_QOS) -> None:
        """Declare the publisher.

        `token` is the token of a publisher of rmw_zenoh, whose messages have attachments; None for a bridge. A latched
        publisher keeps its last messages in a cache that both transports query (rmw_zenoh: rmw_publisher_data.cpp;
        zenoh-plugin-ros2dds: route_publisher.rs, route_subscriber.rs).
        """
        self._id = None if token is None else publisher_id(token)
        self._sequence = 0
        self.has_subscribers = qos.latched
        drop = zenoh.CongestionControl.DROP
        if qos.latched:
            cache = CacheConfig(qos.depth)
            self._publisher: Any = declare_advanced_publisher(
                session, key, congestion_control=drop, cache=cache, publisher_detection=True
            )
            return
        self._publisher = session.declare_publisher(key, congestion_control=drop)
        self._publisher.declare_matching_listener(zenoh.handlers.Callback(self._match, indirect=False))
        # The listener does not report earlier subscribers, and may report a change during this query. The loop ends
        # with the newest value; otherwise a connected base might never be noticed.
        while self.has_subscribers != (matching := self._publisher.matching_status.matching):
            self.has_subscribers = matching

    def put(self, payload: bytes, utc_ns: int) -> None:
        """Send a message that was made at this time since 1970."""
        self._sequence += 1
        attached = None if self._id is None else attachment(self._sequence, utc_ns, self._id)
        self._publisher.put(payload, attachment=attached)

    def close(self) -> None:
        """End the publisher and discard its cache."""
        self._publisher.undeclare()

    def _match(self, status: Any) -> None:
        self.has_subscribers = status.matching  # `status` itself is always true
