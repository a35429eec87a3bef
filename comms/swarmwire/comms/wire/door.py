"""Where a world lets others in: endpoints, what it shows of itself there, and who may come."""

from dataclasses import dataclass

import zenoh

from swarmwire.comms.errors import BadInput
from swarmwire.comms.wire.keys import Keys, ObserverKeys
from swarmwire.comms.wire.limits import LIMITS, Limits
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.run_access import RunAccess, agents_access, observers_access
from swarmwire.comms.wire.sessions import open_observed, open_world


@dataclass(frozen=True)
class Door:
    """One of a run's two endpoints, at several places.

    Attributes:
        endpoints: where others call, such as a unix socket and "tls/0.0.0.0:7447".
        network: the certificates; None: none, so that only this machine is reached.
        access: who may do what; None: nobody is told from another.
        limits: what is taken from others at most.
    """

    endpoints: tuple[str, ...]
    network: Network | None = None
    access: RunAccess | None = None
    limits: Limits = LIMITS

    def open_to_runners(self, keys: Keys, runner_timeout_s: float) -> zenoh.Session:
        """The session at which runners join; BadInput if an endpoint is taken, or a file of the certificates unfit."""
        access = None if self.access is None else agents_access(keys, self.access)
        try:
            return open_world(self.endpoints, runner_timeout_s, self.network, access, self.limits)
        except zenoh.ZError as error:
            raise self._closed(error) from error

    def open_to_observers(self, keys: ObserverKeys) -> zenoh.Session:
        """The session at which observers look on; BadInput as above."""
        access = None if self.access is None else observers_access(keys, self.access)
        try:
            return open_observed(self.endpoints, self.network, access)
        except zenoh.ZError as error:
            raise self._closed(error) from error

    def _closed(self, error: zenoh.ZError) -> BadInput:
        reason = str(error).split(" at ")[0]
        places = ", ".join(self.endpoints)
        return BadInput("", places, f"expected an endpoint that is free and can be listened on: {reason}")
