"""Key expressions in the network of robots, real ones and emulated ones that answer as such."""

# pyright: reportUnknownMemberType=false, reportUnknownArgumentType=false

import json
import os
from collections.abc import Iterable, Mapping
from typing import Any

import zenoh

from swarmwire.comms.clock import Clock, WallClock, to_ns, to_s
from swarmwire.comms.errors import BadInput
from swarmwire.comms.wire.network import PROVEN, Network
from swarmwire.comms.wire.sessions import SMALL_RUNTIME, mutual_tls


class SwarmKeys:
    """The keys of one swarm, under `swarmwire/{swarm}/`; who may put what is in the key: a robot's own name."""

    def __init__(self, swarm: str) -> None:
        self.root = f"swarmwire/{swarm}"
        self.any_radio = f"{self.root}/radio/*/*"
        self.any_pose = f"{self.root}/pose/*"
        self.any_control = f"{self.root}/control/*"
        self.any_bridge_sent = f"{self.root}/bridge/*/sent"
        self.any_bridge_join = f"{self.root}/bridge/*/join"

    def radio(self, robot: str, tag: int) -> str:
        """A packet of this robot's; the tag of its message is its topic."""
        return f"{self.root}/radio/{robot}/{tag:04x}"

    def any_radio_of(self, robot: str) -> str:
        """All packets of this robot's."""
        return f"{self.root}/radio/{robot}/*"

    def pose(self, robot: str) -> str:
        """Where a tracker sees this robot, as `poses.encode_pose` has it."""
        return f"{self.root}/pose/{robot}"

    def control(self, robot: str) -> str:
        """Queryable of this robot: "estop" and "status", asked by whoever runs the swarm."""
        return f"{self.root}/control/{robot}"

    def alive(self, robot: str) -> str:
        """Liveliness token of this robot's agent."""
        return f"{self.root}/alive/{robot}"

    def bridge_join(self, robot: str) -> str:
        """Queryable of the world's air: this robot asks for its terms (`BridgeInfo`)."""
        return f"{self.root}/bridge/{robot}/join"

    def bridge_sent(self, robot: str) -> str:
        """From a robot with `--radio medium` to the world's air: `actions` frames, of which the packets count."""
        return f"{self.root}/bridge/{robot}/sent"

    def bridge_received(self, robot: str) -> str:
        """From the world's air to that robot, a `tick` frame for each tick in which it received something."""
        return f"{self.root}/bridge/{robot}/received"


# --- zenoh sessions of the robots' network: peers that link with all that they list, or find by multicast.
#
# No peer passes on what others send, and none gossips about whom it knows: every two that are to meet must be linked,
# so one of them lists the other, or multicast is on. What the network cannot take at once is dropped: it never holds up
# a robot. Opening waits for nobody, and lost links are tried for ever.
#
# Publishers here are not `express`: messages that meet share a batch and come as soon. With a batch for each, a put
# costs ten times as much, and some tens at once overflow the queue (measured on loopback).


# zenoh's stubs leave out the return type of close.


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


# --- The operator's side of control: all robots are asked at once, and each one's reply is waited for until the end.


# zenoh's stubs leave out the return types of some methods.


ESTOP, STATUS = "estop", "status"  # what may be asked
STOPPED = "stopped"  # the reply to ESTOP
POLL_NS = to_ns(0.02)  # how often it is looked for replies, and those are asked who could not be reached before


def ask_all(
    session: zenoh.Session,
    keys: SwarmKeys,
    what: str,
    robots: Iterable[str],
    timeout_s: float,
    clock: Clock | None = None,
) -> dict[str, str | None]:
    """Each robot's reply by its name: "stopped", a JSON text, or what went wrong there; None if none came in time.

    Nobody waits for another. Links may still be on their way up: who cannot be reached is asked until the time is over.
    """
    clock = clock or WallClock()
    replies: dict[str, str | None] = dict.fromkeys(robots)
    asked: dict[str, zenoh.Handler[zenoh.Reply]] = {}
    end_ns = clock.now_ns() + to_ns(timeout_s)
    while missing := [robot for robot, reply in replies.items() if reply is None]:
        left_ns = end_ns - clock.now_ns()
        if left_ns <= 0:
            break
        for robot in missing:
            if robot not in asked:
                asked[robot] = session.get(
                    keys.control(robot), target=zenoh.QueryTarget.ALL, payload=what, timeout=to_s(left_ns)
                )
        clock.sleep_until(min(clock.now_ns() + POLL_NS, end_ns))
        for robot in missing:
            try:
                replies[robot] = _reply(asked[robot].try_recv())
            except zenoh.ZError:  # nobody answers, or not any more
                del asked[robot]
    return replies


def _reply(answer: zenoh.Reply | None) -> str | None:
    """What a robot replied, if it did; that the time is over zenoh tells as an error."""
    if answer is None:
        return None
    if answer.ok is not None:
        return answer.ok.payload.to_string()
    error = answer.err.payload.to_string() if answer.err else ""
    return None if error == "Timeout" else error
