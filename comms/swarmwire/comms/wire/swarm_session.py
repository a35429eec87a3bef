"""zenoh sessions of the robots' network: peers that link with all that they list, or find by multicast.

No peer passes on what others send, and none gossips about whom it knows: every two that are to meet must be linked, so
one of them lists the other, or multicast is on. What the network cannot take at once is dropped: it never holds up a
robot. Opening waits for nobody, and lost links are tried for ever.

Publishers here are not `express`: messages that meet share a batch and come as soon. With a batch for each, a put costs
ten times as much, and some tens at once overflow the queue (measured on loopback).
"""

# zenoh's stubs leave out the return type of close.
# pyright: reportUnknownMemberType=false, reportUnknownArgumentType=false

import json
import os
from collections.abc import Mapping
from typing import Any

import zenoh

from swarmwire.comms.errors import BadInput
from swarmwire.comms.wire.mutual_tls import mutual_tls
from swarmwire.comms.wire.network import PROVEN, Network
from swarmwire.comms.wire.sessions import SMALL_RUNTIME

LEASE_MS = 3000  # a robot that is frozen or out of reach is noticed after this
RETRY = {"period_init_ms": 200, "period_max_ms": 2000, "period_increase_factor": 1.5}
LOCATORS_S = 2.0


def open_swarm(network: Network, access: Mapping[str, Any] | None = None, small: bool = True) -> zenoh.Session:
    """A peer with these settings; BadInput if an endpoint is taken, or the certificate cannot be used.

    `access` is zenoh's access control. A `small` session has few threads, as fits a robot: the first one that a process
    opens decides for all of them.
    """
    if small:
        os.environ.setdefault("ZENOH_RUNTIME", SMALL_RUNTIME)
    try:
        return zenoh.open(zenoh.Config.from_json5(json.dumps(swarm_config(network, access))))
    except zenoh.ZError as error:
        reason = str(error).split(" at ")[0]
        listens = ", ".join(network.listen) or "multicast"
        raise BadInput("network", listens, f"expected endpoints that are free, and files that fit: {reason}") from error


def swarm_config(network: Network, access: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """The configuration, as zenoh has it, of a peer with these settings."""
    listen = _listens(network)
    link: dict[str, Any] = {"tx": {"lease": LEASE_MS, "keep_alive": 4}}
    if network.proves:
        link |= {"protocols": list(PROVEN), "tls": mutual_tls(network)}
    config: dict[str, Any] = {
        "mode": "peer",
        "listen": {"endpoints": list(listen)},
        "connect": {"endpoints": list(network.connect), "timeout_ms": -1, "exit_on_failure": False, "retry": RETRY},
        "scouting": {"delay": 0, "multicast": {"enabled": network.multicast}, "gossip": {"enabled": False}},
        "transport": {"shared_memory": {"enabled": False}, "link": link},
    }
    if _any_port(listen):  # or nobody could tell which port it became
        config["adminspace"] = {"enabled": True, "permissions": {"read": True, "write": False}}
    if access is not None:
        config["access_control"] = dict(access)
    return config


def endpoints_of(session: zenoh.Session, network: Network) -> tuple[str, ...]:
    """Where the session of these settings can be called, with the ports that the system chose."""
    listen = _listens(network)
    if not _any_port(listen):
        return listen
    for reply in session.get(f"@/{session.zid()}/peer", timeout=LOCATORS_S):
        if reply.ok is not None:
            return tuple(json.loads(reply.ok.payload.to_string())["locators"])
    return listen


def _listens(network: Network) -> tuple[str, ...]:
    """Where a member listens; one that is to be found by multicast must do so somewhere."""
    if network.multicast and not network.listen:
        return ("tls/0.0.0.0:0" if network.proves else "tcp/0.0.0.0:0",)
    return network.listen


def _any_port(listen: tuple[str, ...]) -> bool:
    return any(endpoint.endswith(":0") for endpoint in listen)
