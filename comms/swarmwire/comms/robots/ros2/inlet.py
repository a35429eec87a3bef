"""One topic on its way in: payloads as they come, those that rmw_zenoh would drop counted instead."""

from collections.abc import Callable
from typing import Any

import zenoh

from swarmwire.comms.errors import BadFrame
from swarmwire.comms.robots.ros2.attachment import check_attachment


class Inlet:
    """A subscriber on one key. `take` gets each payload, in the thread of the network, so it must be done at once."""

    def __init__(
        self,
        session: zenoh.Session,
        key: str,
        *,
        attached: bool,
        take: Callable[[bytes], None],
        refuse: Callable[[str], None],
    ) -> None:
        """`attached` is whether messages come with rmw_zenoh's attachment; `refuse` gets the fault of one without."""
        self._attached, self._take, self._refuse = attached, take, refuse
        self._subscriber: Any = session.declare_subscriber(key, zenoh.handlers.Callback(self._receive, indirect=False))

    def close(self) -> None:
        """Nobody subscribes any more."""
        self._subscriber.undeclare()

    def _receive(self, sample: zenoh.Sample) -> None:
        if self._attached:
            try:
                check_attachment(None if sample.attachment is None else sample.attachment.to_bytes())
            except BadFrame as error:
                self._refuse(error.fault)
                return
        self._take(sample.payload.to_bytes())
