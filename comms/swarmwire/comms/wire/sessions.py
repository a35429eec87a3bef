"""zenoh sessions: the world routes on an endpoint for runners and on one for observers, who are clients of it.

Nothing scouts, nothing gossips. The two endpoints are sessions of their own, so that no runner can see the truth.

Two peers on one hub are not routed by zenoh, or link past it; so the world is a router and runners are clients. The
start-up delay of scouting is set to 0 even where it is off (it costs half a second otherwise). Frames in lockstep block
rather than drop; a put that blocks closes its link after `BLOCK_S` or half a runner's time-out.
"""

import json
import os

import zenoh

PRIVATE = "sw-"  # how the name of a private directory for a socket begins
BLOCK_S = 5.0
LEASE_MS = 10_000  # a frozen peer is noticed after this; a dead one at once, by its closed socket
# A runner has one session and little traffic: three threads instead of ten, and half the memory.
SMALL_RUNTIME = "(rx:(handover:app),acc:(handover:app),tx:(handover:app),net:(handover:app),app:(worker_threads:1))"


def open_world(endpoint: str, runner_timeout_s: float) -> zenoh.Session:
    """A router that listens on `endpoint`, for runners that may be silent so long; zenoh.ZError if it is taken."""
    return zenoh.open(_config("router", {"listen": {"endpoints": [endpoint]}}, runner_timeout_s))


def open_runner(endpoint: str, connect_s: float = 10.0) -> zenoh.Session:
    """A client of the world at `endpoint`, tried for `connect_s`; zenoh.ZError if nobody answers."""
    os.environ.setdefault("ZENOH_RUNTIME", SMALL_RUNTIME)
    connect = {
        "endpoints": [endpoint],
        "timeout_ms": round(connect_s * 1000),
        "retry": {"period_init_ms": 50, "period_max_ms": 1000, "period_increase_factor": 1.5},
    }
    return zenoh.open(_config("client", {"connect": connect}))


def open_observed(endpoint: str) -> zenoh.Session:
    """A router that listens on `endpoint`, for observers; zenoh.ZError if it is taken."""
    return zenoh.open(_config("router", {"listen": {"endpoints": [endpoint]}}))


def open_observer(endpoint: str) -> zenoh.Session:
    """A client of the observers' endpoint; zenoh.ZError if nobody answers within 2 s."""
    return open_runner(endpoint, connect_s=2.0)


def unix_endpoint(path: str) -> str:
    """The endpoint of a unix socket; a path may have 108 characters at most."""
    return f"unixsock-stream/{path}"


def _config(mode: str, more: dict[str, object], runner_timeout_s: float = 2 * BLOCK_S) -> zenoh.Config:
    block = {"wait_before_close": round(min(BLOCK_S, runner_timeout_s / 2) * 1e6)}
    lease_ms = max(LEASE_MS, round(runner_timeout_s * 1000))
    return zenoh.Config.from_json5(
        json.dumps(
            {
                "mode": mode,
                "scouting": {"delay": 0, "multicast": {"enabled": False}, "gossip": {"enabled": False}},
                "transport": {
                    "shared_memory": {"enabled": False},
                    "link": {"tx": {"lease": lease_ms, "queue": {"congestion_control": {"block": block}}}},
                },
                **more,
            }
        )
    )
