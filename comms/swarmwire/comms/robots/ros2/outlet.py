"""One topic on its way out, with or without rmw_zenoh's attachment."""

from typing import Any

import zenoh

from swarmwire.comms.robots.ros2.attachment import attachment, publisher_id


class Outlet:
    """A publisher on one key. Payloads are dropped where the network cannot keep up.

    Attributes:
        wanted: whether anybody subscribes. It is told from the thread of the network: to ask costs 1 to 20 us, and a
            gateway has hundreds of these.
    """

    def __init__(self, session: zenoh.Session, key: str, token: str | None) -> None:
        """`token`: that of a publisher of rmw_zenoh, whose messages have attachments; None: it is a bridge's."""
        self._publisher: Any = session.declare_publisher(key, congestion_control=zenoh.CongestionControl.DROP)
        self._id = None if token is None else publisher_id(token)
        self._sequence = 0
        self.wanted = False
        self._publisher.declare_matching_listener(zenoh.handlers.Callback(self._match, indirect=False))
        # Whoever was there before is not told of. The listener may tell of a change while that is asked: the last word
        # must be the newest, or a base that is there would never be found.
        while self.wanted != (now := self._publisher.matching_status.matching):
            self.wanted = now

    def put(self, payload: bytes, utc_ns: int) -> None:
        """Send a message, which was made at this time since 1970."""
        self._sequence += 1
        attached = None if self._id is None else attachment(self._sequence, utc_ns, self._id)
        self._publisher.put(payload, attachment=attached)

    def _match(self, status: Any) -> None:
        self.wanted = status.matching  # the object itself is true in any case
