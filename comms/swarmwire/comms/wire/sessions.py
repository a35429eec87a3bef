"""The end of a process whose sessions are still closing, which zenoh may take ten seconds for.

Python must not be torn down meanwhile: a thread that comes back from zenoh then finds no interpreter, and the process
aborts ("exception not rethrown"). So the end waits for such threads, or is made at once by `end_now`.
"""

# pyright: reportUnknownMemberType=false, reportUnknownArgumentType=false

import atexit
import json
import logging
import os
import sys
import threading
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import zenoh

from swarmwire.comms.wire.join import LIMITS, JoinLimits
from swarmwire.comms.wire.network import Network, protocol_of

MAX_S = 12.0  # after ten seconds zenoh gives up

_left: list[threading.Thread] = []


def left_closing(closing: threading.Thread) -> None:
    """A thread that goes on closing a session, for which nobody waits but the end of the process."""
    _left.append(closing)
    atexit.register(closing.join, MAX_S)


def end_now(code: int) -> None:
    """End this process if a session is still closing, with nothing more done; else return. For the end of programs."""
    if any(closing.is_alive() for closing in _left):
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


# --- Closing zenoh sessions, which may wait ten seconds for a peer that is frozen, out of reach, or about to close,
# too.
#
# zenoh then raises "close operation timed out" (its issue 2675). Nothing is lost by that: the session is of no use any
# more, and all that it holds ends with the process.


# zenoh's stubs leave out the return type of close.


TIMEOUT_S = 1.0  # whoever is well answers in milliseconds

log = logging.getLogger(__name__)


def close_session(session: zenoh.Session, patience_s: float = TIMEOUT_S) -> None:
    """Close a session, waiting no longer than so for those who do not answer; safe to call again."""
    closing = threading.Thread(target=_close, args=(session,), name="closing", daemon=True)
    closing.start()
    closing.join(patience_s)
    if closing.is_alive():
        left_closing(closing)


@contextmanager
def closed_after(session: zenoh.Session) -> Generator[zenoh.Session]:
    """The session, closed with the context."""
    try:
        yield session
    finally:
        close_session(session)


def _close(session: zenoh.Session) -> None:
    try:
        session.close()
    except zenoh.ZError as error:
        log.info("a session was left to the end of the process: %s", error)


# --- The certificates of one end of a zenoh link: both ends show theirs, whoever called.


def mutual_tls(network: Network) -> dict[str, Any]:
    """Zenoh's `transport/link/tls` for a member with these certificates."""
    certificate, key = str(network.certificate), str(network.key)
    return {
        "root_ca_certificate": str(network.ca),
        "enable_mtls": True,
        "listen_certificate": certificate,
        "listen_private_key": key,
        "connect_certificate": certificate,
        "connect_private_key": key,
    }


# --- zenoh sessions: the world routes on some endpoints for runners and on others for observers, who are clients of it.
#
# Nothing scouts, nothing gossips. The two are sessions of their own, so that no runner can see the truth. Routers may
# stand between a world and its runners, in a chain: each listens for the next and calls the one before.
#
# Two peers on one hub are not routed by zenoh, or link past it; so the world is a router and runners are clients. The
# start-up delay of scouting is set to 0 even where it is off (it costs half a second otherwise). Frames in lockstep
# block rather than drop; a put that blocks closes its link after `BLOCK_S` or half a runner's time-out.


# zenoh's stubs leave out the type of what a session answers.


PRIVATE = "sw-"  # how the name of a private directory for a socket begins
BLOCK_S = 5.0
# A dead peer is noticed at once, by its closed socket. One that is frozen or out of reach is noticed after its lease:
# on one machine practically never, since nobody is out of reach there, and whoever was stopped may go on; a run's own
# time-outs count there. Elsewhere a world allows itself as long as it allows its runners.
MIN_LEASE_MS = 10_000
CLIENT_LEASE_MS = 60_000
LOCAL_LEASE_MS = 7 * 86_400_000
LOCAL = "unixsock-stream/"
LOCATORS_S = 2.0
RETRY = {"period_init_ms": 50, "period_max_ms": 1000, "period_increase_factor": 1.5}
SPARE_LINKS = 64  # of routers, and of runners whose old link is not yet known to be dead
# A runner has one session and little traffic: three threads instead of ten, and half the memory.
SMALL_RUNTIME = "(rx:(handover:app),acc:(handover:app),tx:(handover:app),net:(handover:app),app:(worker_threads:1))"

Endpoints = str | Sequence[str]


def open_world(
    endpoints: Endpoints,
    runner_timeout_s: float,
    network: Network | None = None,
    access: Mapping[str, Any] | None = None,
    limits: JoinLimits = LIMITS,
) -> zenoh.Session:
    """A router that listens at `endpoints`, for runners that may be silent so long.

    `network` brings the certificates, `access` is zenoh's access control. zenoh.ZError if an endpoint is taken or a
    file of the certificates is not fit; BadInput for an endpoint beyond this machine without certificates.
    """
    return zenoh.open(_router(endpoints, (), runner_timeout_s, network, access, limits))


def open_router(
    listen: Endpoints,
    connect: Endpoints,
    network: Network | None = None,
    access: Mapping[str, Any] | None = None,
    limits: JoinLimits = LIMITS,
) -> zenoh.Session:
    """A router between a world and its runners: it calls the endpoints in `connect` for ever. Errors as `open_world`.

    It waits for nobody: whom it calls may come later, or again.
    """
    return zenoh.open(_router(listen, connect, 2 * BLOCK_S, network, access, limits))


def open_runner(endpoint: str, connect_s: float = 10.0, network: Network | None = None) -> zenoh.Session:
    """A client of the world at `endpoint`, tried for `connect_s`; zenoh.ZError if nobody answers.

    BadInput for an endpoint beyond this machine without certificates.
    """
    os.environ.setdefault("ZENOH_RUNTIME", SMALL_RUNTIME)
    connect = {"endpoints": [endpoint], "timeout_ms": round(connect_s * 1000), "retry": RETRY}
    settings = _settings("client", {"connect": connect}, [endpoint], network, lease_ms=CLIENT_LEASE_MS)
    return zenoh.open(_as_config(settings))


def open_observed(
    endpoints: Endpoints, network: Network | None = None, access: Mapping[str, Any] | None = None
) -> zenoh.Session:
    """A router that listens at `endpoints`, for observers. Errors as `open_world`."""
    return zenoh.open(_router(endpoints, (), 2 * BLOCK_S, network, access, LIMITS))


def open_observer(endpoint: str, network: Network | None = None) -> zenoh.Session:
    """A client of the observers' endpoint; zenoh.ZError if nobody answers within 2 s."""
    return open_runner(endpoint, 2.0, network)


def listens_at(session: zenoh.Session) -> tuple[str, ...]:
    """Where a router's session can be called, with the ports that the system chose."""
    for reply in session.get(f"@/{session.zid()}/router", timeout=LOCATORS_S):
        if reply.ok is not None:
            return tuple(json.loads(reply.ok.payload.to_string())["locators"])
    return ()


def router_config(
    listen: Endpoints,
    connect: Endpoints,
    runner_timeout_s: float = 2 * BLOCK_S,
    network: Network | None = None,
    access: Mapping[str, Any] | None = None,
    limits: JoinLimits = LIMITS,
) -> dict[str, Any]:
    """The configuration, as zenoh has it, of a router between a world and its runners, and of a world."""
    listened, called = _several(listen), _several(connect)
    more: dict[str, Any] = {
        "listen": {"endpoints": listened},
        # Only the session itself may ask: an access control that denies what it does not name denies this to links.
        "adminspace": {"enabled": True, "permissions": {"read": True, "write": False}},
    }
    if called:
        more["connect"] = {"endpoints": called, "timeout_ms": -1, "exit_on_failure": False, "retry": RETRY}
    if access is not None:
        more["access_control"] = dict(access)
    config = _settings("router", more, [*listened, *called], network, runner_timeout_s)
    config["transport"]["link"]["rx"] = {"max_message_size": limits.link_bytes}
    config["transport"]["unicast"] = {"max_sessions": limits.runners + SPARE_LINKS}
    return config


def unix_endpoint(path: str) -> str:
    """The endpoint of a unix socket; a path may have 108 characters at most."""
    return f"{LOCAL}{path}"


def _router(
    listen: Endpoints,
    connect: Endpoints,
    runner_timeout_s: float,
    network: Network | None,
    access: Mapping[str, Any] | None,
    limits: JoinLimits,
) -> zenoh.Config:
    return _as_config(router_config(listen, connect, runner_timeout_s, network, access, limits))


def _as_config(settings: dict[str, Any]) -> zenoh.Config:
    return zenoh.Config.from_json5(json.dumps(settings))


def _several(endpoints: Endpoints) -> list[str]:
    return [endpoints] if isinstance(endpoints, str) else list(endpoints)


def _settings(
    mode: str,
    more: dict[str, Any],
    endpoints: Sequence[str],
    network: Network | None,
    runner_timeout_s: float = 2 * BLOCK_S,
    lease_ms: int = MIN_LEASE_MS,
) -> dict[str, Any]:
    for endpoint in endpoints:
        (network or Network()).check_safe(endpoint, "network", "endpoint")
    block = {"wait_before_close": round(min(BLOCK_S, runner_timeout_s / 2) * 1e6)}
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
        **more,
    }
