"""zenoh sessions of a gateway, which routes as a ROS 2 router does, and of a driver, which is a client of one."""

import json
import re

import zenoh

from swarmwire.comms.errors import BadInput
from swarmwire.comms.wire.closing import close_session

ENDPOINT = re.compile(r"(tcp|udp|ws)/.+:\d+|unixsock-stream/.+")
EXAMPLE = "tcp/192.168.1.7:7447"
LEASE_MS = 2000  # a peer that is cut off is noticed after this
CLOSE_S = 10.0  # as long as zenoh itself waits: a robot's last command may be on its way


def check_endpoint(endpoint: str, where: str, key: str) -> None:
    """Raise BadInput with `where` and `key` if this is no endpoint of zenoh."""
    if not ENDPOINT.fullmatch(endpoint):
        raise BadInput(where, key, f"expected an endpoint of zenoh such as {EXAMPLE}, got {endpoint!r}")


def open_router(endpoint: str) -> tuple[zenoh.Session, str]:
    """A router that listens on `endpoint`, and where it does so; zenoh.ZError if it is taken.

    It gossips, as rmw_zenoh's router does: without one, nodes find one another through it.
    """
    more: dict[str, object] = {
        "listen": {"endpoints": [endpoint]},
        "adminspace": {"enabled": True, "permissions": {"read": True, "write": False}},  # tells the port
    }
    session = zenoh.open(_config("router", more, gossip=True))
    for reply in session.get(f"@/{session.zid()}/router", timeout=2.0):
        if reply.ok is not None:
            return session, json.loads(reply.ok.payload.to_string())["locators"][0]
    return session, endpoint


def open_client(endpoint: str, connect_s: float) -> zenoh.Session:
    """A client of the router at `endpoint`, tried for `connect_s`; zenoh.ZError if nobody answers."""
    connect = {
        "endpoints": [endpoint],
        "timeout_ms": round(connect_s * 1000),
        "retry": {"period_init_ms": 50, "period_max_ms": 500, "period_increase_factor": 1.5},
    }
    return zenoh.open(_config("client", {"connect": connect}, gossip=False))


def close(session: zenoh.Session) -> None:
    """Close a session; what was put before still goes out."""
    close_session(session, CLOSE_S)


def is_linked(session: zenoh.Session) -> bool:
    """Whether a client has its router."""
    return bool(session.info.routers_zid() or session.info.peers_zid())


def _config(mode: str, more: dict[str, object], *, gossip: bool) -> zenoh.Config:
    return zenoh.Config.from_json5(
        json.dumps(
            {
                "mode": mode,
                "scouting": {"delay": 0, "multicast": {"enabled": False}, "gossip": {"enabled": gossip}},
                "transport": {"shared_memory": {"enabled": False}, "link": {"tx": {"lease": LEASE_MS}}},
                **more,
            }
        )
    )
