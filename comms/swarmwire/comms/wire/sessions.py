"""zenoh sessions between a world, its runners, its observers and routers: opening and closing.

The world is a router with two sessions: one for runners and one for observers, so that no runner can see the truth.
Runners and observers are its clients. Routers may form a chain between a world and its runners: each router listens for
the next and connects to the previous. Sessions neither scout nor gossip.

The world is a router and runners are clients, since zenoh does not route between two peers at a hub, or links them
past it. The start-up delay of scouting is set to 0 although scouting is off, since it costs half a second otherwise.
Frames in lockstep block rather than drop; a put that blocks closes its link after `BLOCK_TIMEOUT_S` or half a runner's
time-out.
"""

# zenoh's stubs leave out some return types.
# pyright: reportUnknownMemberType=false, reportUnknownArgumentType=false

import json
import logging
import os
import threading
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import zenoh

from swarmwire.comms.wire.ending import wait_at_exit
from swarmwire.comms.wire.limits import LIMITS, JoinLimits
from swarmwire.comms.wire.network import Network, protocol_of

CLOSE_TIMEOUT_S = 1.0  # a healthy peer answers within milliseconds
BLOCK_TIMEOUT_S = 5.0
LOCATORS_TIMEOUT_S = 2.0
# A dead peer is noticed at once, by its closed socket; a frozen or unreachable peer is noticed after its lease. On one
# machine the lease practically never ends, since no peer is unreachable and a stopped process may continue; the run has
# time-outs for such peers. Between machines, a world's lease is at least the time-out of its runners.
MIN_LEASE_MS = 10_000
CLIENT_LEASE_MS = 60_000
LOCAL_LEASE_MS = 7 * 86_400_000
LOCAL = "unixsock-stream/"
PRIVATE = "sw-"  # name prefix of a private directory for a socket
RETRY = {"period_init_ms": 50, "period_max_ms": 1000, "period_increase_factor": 1.5}
SPARE_LINKS = 64  # links of routers, and old links of reconnected runners that have not been closed yet
# Three threads instead of ten, with half the memory, since a runner has one session and little traffic.
SMALL_RUNTIME = "(rx:(handover:app),acc:(handover:app),tx:(handover:app),net:(handover:app),app:(worker_threads:1))"

Endpoints = str | Sequence[str]

log = logging.getLogger(__name__)


def close_session(session: zenoh.Session, timeout_s: float = CLOSE_TIMEOUT_S) -> None:
    """Close a session within at most `timeout_s`; safe to call again.

    zenoh may wait ten seconds for a peer that is frozen, unreachable, or closing too, and then raises "close operation
    timed out" (its issue 2675). That loses nothing: the session is not used again, and its resources end with the
    process.
    """
    closing = threading.Thread(target=_close, args=(session,), name="closing", daemon=True)
    closing.start()
    closing.join(timeout_s)
    if closing.is_alive():
        wait_at_exit(closing)


@contextmanager
def closed_after(session: zenoh.Session) -> Generator[zenoh.Session]:
    """Close a session at the end of the context."""
    try:
        yield session
    finally:
        close_session(session)


def _close(session: zenoh.Session) -> None:
    try:
        session.close()
    except zenoh.ZError as error:
        log.info("a session stays open until the process ends: %s", error)


def mutual_tls(network: Network) -> dict[str, Any]:
    """Return zenoh's `transport/link/tls` for a member with these certificates; both ends of a link present theirs."""
    certificate, key = str(network.certificate), str(network.key)
    return {
        "root_ca_certificate": str(network.ca),
        "enable_mtls": True,
        "listen_certificate": certificate,
        "listen_private_key": key,
        "connect_certificate": certificate,
        "connect_private_key": key,
    }


def open_world(
    endpoints: Endpoints,
    runner_timeout_s: float,
    network: Network | None = None,
    access: Mapping[str, Any] | None = None,
    limits: JoinLimits = LIMITS,
) -> zenoh.Session:
    """Open a router that listens at `endpoints`, for runners that may be silent for `runner_timeout_s`.

    `network` has the certificates, `access` is zenoh's access control. zenoh.ZError if an endpoint is taken or a
    certificate file is invalid; BadInput for an endpoint beyond this machine without certificates.
    """
    return zenoh.open(_router(endpoints, (), runner_timeout_s, network, access, limits))


def open_router(
    listen: Endpoints,
    connect: Endpoints,
    network: Network | None = None,
    access: Mapping[str, Any] | None = None,
) -> zenoh.Session:
    """Open a router between a world and its runners, which connects to the endpoints in `connect`.

    It returns at once, even before these endpoints exist, and reconnects when a link is lost. Raises the errors of
    `open_world`.
    """
    return zenoh.open(_router(listen, connect, 2 * BLOCK_TIMEOUT_S, network, access, LIMITS))


def open_runner(endpoint: str, connect_s: float = 10.0, network: Network | None = None) -> zenoh.Session:
    """Open a client of the world at `endpoint`; zenoh.ZError if the world does not answer within `connect_s`.

    BadInput for an endpoint beyond this machine without certificates.
    """
    os.environ.setdefault("ZENOH_RUNTIME", SMALL_RUNTIME)
    connect = {"endpoints": [endpoint], "timeout_ms": round(connect_s * 1000), "retry": RETRY}
    settings = _settings("client", {"connect": connect}, [endpoint], network, lease_ms=CLIENT_LEASE_MS)
    return zenoh.open(_as_config(settings))


def open_observed(
    endpoints: Endpoints, network: Network | None = None, access: Mapping[str, Any] | None = None
) -> zenoh.Session:
    """Open a router that listens at `endpoints`, for observers. Raises the errors of `open_world`."""
    return zenoh.open(_router(endpoints, (), 2 * BLOCK_TIMEOUT_S, network, access, LIMITS))


def open_observer(endpoint: str, network: Network | None = None) -> zenoh.Session:
    """Open a client of the observers' endpoint; zenoh.ZError if it does not answer within 2 s."""
    return open_runner(endpoint, 2.0, network)


def listens_at(session: zenoh.Session) -> tuple[str, ...]:
    """Return the endpoints of a router's session, with the ports that the system chose."""
    for reply in session.get(f"@/{session.zid()}/router", timeout=LOCATORS_TIMEOUT_S):
        if reply.ok is not None:
            return tuple(json.loads(reply.ok.payload.to_string())["locators"])
    return ()


def unix_endpoint(path: str) -> str:
    """Return the endpoint of a unix socket; a path has at most 108 characters."""
    return f"{LOCAL}{path}"


def _router(
    listen: Endpoints,
    connect: Endpoints,
    runner_timeout_s: float,
    network: Network | None,
    access: Mapping[str, Any] | None,
    limits: JoinLimits,
) -> zenoh.Config:
    """Return the configuration of a world, or of a router between a world and its runners."""
    listen_endpoints, connect_endpoints = _as_list(listen), _as_list(connect)
    sections: dict[str, Any] = {
        "listen": {"endpoints": listen_endpoints},
        # Only this session can query it: an access control that denies by default denies it to links.
        "adminspace": {"enabled": True, "permissions": {"read": True, "write": False}},
    }
    if connect_endpoints:
        sections["connect"] = {
            "endpoints": connect_endpoints,
            "timeout_ms": -1,
            "exit_on_failure": False,
            "retry": RETRY,
        }
    if access is not None:
        sections["access_control"] = dict(access)
    config = _settings("router", sections, [*listen_endpoints, *connect_endpoints], network, runner_timeout_s)
    config["transport"]["link"]["rx"] = {"max_message_size": limits.link_bytes}
    links = limits.runners + SPARE_LINKS
    # Silent connections are closed after 10 s; with zenoh's limit of 100, they could exclude all others until then.
    config["transport"]["unicast"] = {"max_sessions": links, "accept_pending": links}
    return _as_config(config)


def _as_config(settings: dict[str, Any]) -> zenoh.Config:
    return zenoh.Config.from_json5(json.dumps(settings))


def _as_list(endpoints: Endpoints) -> list[str]:
    return [endpoints] if isinstance(endpoints, str) else list(endpoints)


def _settings(
    mode: str,
    sections: dict[str, Any],
    endpoints: Sequence[str],
    network: Network | None,
    runner_timeout_s: float = 2 * BLOCK_TIMEOUT_S,
    lease_ms: int = MIN_LEASE_MS,
) -> dict[str, Any]:
    """Return zenoh's settings of a mode with these further sections; BadInput for an unsafe endpoint."""
    for endpoint in endpoints:
        (network or Network()).check_safe(endpoint, "network", "endpoint")
    block = {"wait_before_close": round(min(BLOCK_TIMEOUT_S, runner_timeout_s / 2) * 1e6)}
    lease_ms = max(lease_ms, round(runner_timeout_s * 1000))
    if all(endpoint.startswith(LOCAL) for endpoint in endpoints):
        lease_ms = max(lease_ms, LOCAL_LEASE_MS)
    link: dict[str, Any] = {"tx": {"lease": lease_ms, "queue": {"congestion_control": {"block": block}}}}
    if network is not None and network.proves:
        link |= {"protocols": sorted({protocol_of(endpoint) for endpoint in endpoints}), "tls": mutual_tls(network)}
    return {
        "mode": mode,
        "scouting": {"delay": 0, "multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "transport": {"shared_memory": {"enabled": False}, "link": link},
        **sections,
    }
