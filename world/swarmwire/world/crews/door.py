"""Where runners meet the world, and who is let in."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from swarmwire.comms.wire.network import Network


@dataclass(frozen=True)
class Door:
    """The agents' side of a world in the network.

    Attributes:
        endpoints: where it listens.
        network: its certificates; None: none, for this machine alone.
        access: zenoh's access control; None: whoever reaches an endpoint may do anything there.
    """

    endpoints: tuple[str, ...]
    network: Network | None = None
    access: Mapping[str, Any] | None = None
