"""The network of robots, real or emulated: its keys, its zenoh peers, and control requests to all robots.

A member is a zenoh peer that connects to all members in its settings, or discovers them by multicast. Peers neither
forward messages of others nor gossip: two members that exchange messages need a link, so one of them lists the other,
or multicast is on. The network drops messages that it cannot send at once, so it never delays a robot. Opening returns
at once, and lost links are retried for ever.

Publishers are not `express`: messages put at about the same time share a batch and arrive no later. With a batch per
message, a put costs ten times as much, and some tens of simultaneous puts overflow the queue (measured on loopback).
"""

# zenoh's stubs leave out some return types.
# pyright: reportUnknownMemberType=false, reportUnknownArgumentType=false

import json
import os
from collections.abc import Iterable, Mapping
from typing import Any

import zenoh

from swarmwire.comms.base.clock import WallClock, to_ns, to_s
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.wire.keys import SwarmKeys
from swarmwire.comms.wire.network import PROVEN, Network
from swarmwire.comms.wire.sessions import SMALL_RUNTIME, mutual_tls

LEASE_MS = 3000  # time after which a frozen or unreachable robot is noticed
RETRY = {"period_init_ms": 200, "period_max_ms": 2000, "period_increase_factor": 1.5}
LOCATORS_TIMEOUT_S = 2.0
ESTOP, STATUS = "estop", "status"  # control requests
STOPPED = "stopped"  # reply to ESTOP
POLL_NS = to_ns(0.02)  # interval of polls for replies, and of attempts to reach a robot


def open_swarm(network: Network, access: Mapping[str, Any] | None = None, small: bool = True) -> zenoh.Session:
    """Open a peer with these settings; BadInput if an endpoint is taken, or the certificate cannot be used.

    `access` is zenoh's access control. A `small` session has few threads, for a robot; the first session of a process
    determines the threads of all later sessions.
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
    """Return the zenoh configuration of a peer with these settings."""
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
    if _any_port(listen):  # `endpoints_of` reads the port from the admin space
        config["adminspace"] = {"enabled": True, "permissions": {"read": True, "write": False}}
    if access is not None:
        config["access_control"] = dict(access)
    return config


def endpoints_of(session: zenoh.Session, network: Network) -> tuple[str, ...]:
    """Return the endpoints of a session with these settings, with the ports that the system chose."""
    listen = _listens(network)
    if not _any_port(listen):
        return listen
    for reply in session.get(f"@/{session.zid()}/peer", timeout=LOCATORS_TIMEOUT_S):
        if reply.ok is not None:
            return tuple(json.loads(reply.ok.payload.to_string())["locators"])
    return listen


def _listens(network: Network) -> tuple[str, ...]:
    """Return the endpoints of a member; a member that others find by multicast needs at least one."""
    if network.multicast and not network.listen:
        return ("tls/0.0.0.0:0" if network.proves else "tcp/0.0.0.0:0",)
    return network.listen


def _any_port(listen: tuple[str, ...]) -> bool:
    return any(endpoint.endswith(":0") for endpoint in listen)


def ask_all(
    session: zenoh.Session, keys: SwarmKeys, request: str, robots: Iterable[str], timeout_s: float
) -> dict[str, str | None]:
    """Send a control request to all robots at once; return each robot's reply by its name.

    A reply is "stopped", a JSON text or an error; None if none came in time. A robot that cannot be reached is asked
    again until the time is over, since links may still be opening.
    """
    clock = WallClock()
    replies: dict[str, str | None] = dict.fromkeys(robots)
    queries: dict[str, zenoh.Handler[zenoh.Reply]] = {}
    deadline_ns = clock.now_ns() + to_ns(timeout_s)
    while missing := [robot for robot, reply in replies.items() if reply is None]:
        remaining_ns = deadline_ns - clock.now_ns()
        if remaining_ns <= 0:
            break
        for robot in missing:
            if robot not in queries:
                queries[robot] = session.get(
                    keys.control(robot), target=zenoh.QueryTarget.ALL, payload=request, timeout=to_s(remaining_ns)
                )
        clock.sleep_until(min(clock.now_ns() + POLL_NS, deadline_ns))
        for robot in missing:
            try:
                replies[robot] = _reply(queries[robot].try_recv())
            except zenoh.ZError:  # no robot answered the query, or its last reply has been received
                del queries[robot]
    return replies


def _reply(answer: zenoh.Reply | None) -> str | None:
    """Return a robot's reply, None if there is none; zenoh reports a time-out as an error."""
    if answer is None:
        return None
    if answer.ok is not None:
        return answer.ok.payload.to_string()
    error = answer.err.payload.to_string() if answer.err else ""
    return None if error == "Timeout" else error
