"""Where agents of a run's robots wait for one another: ports of this machine alone."""

import socket
from collections.abc import Sequence
from contextlib import ExitStack

from swarmwire.comms.wire.network import Network


def listening_places(names: Sequence[str], network: Network) -> dict[str, str]:
    """By robot, in their order: an endpoint on loopback with a port that is free now, and no other's.

    With certificates there are none: those are made out to addresses, which their owner knows.
    """
    if network.proves:
        return {}
    with ExitStack() as stack:
        held = [stack.enter_context(socket.create_server(("127.0.0.1", 0))) for _ in names]
        return {name: f"tcp/127.0.0.1:{one.getsockname()[1]}" for name, one in zip(names, held, strict=True)}
