"""How runners join a run: its limits, the session info that it offers, and the join request of a runner.

Session info and requests are msgpack maps, checked on arrival. The limits bound the effect of one admitted runner on
the memory of a world and on the other runners: messages beyond them are refused or dropped, and counted where they
reach the world. They do not bound the runner's share of the machine: see docs/security.md.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Annotated, Any

import msgpack
from msgspec import Meta

from swarmwire.comms.errors import BadFrame
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.frames import MAX_BYTES, VERSION, typed, unpacked

MAX_JOIN_BYTES = 1024 * 1024
Sha256 = Annotated[str, Meta(pattern=r"^[0-9a-f]{64}\Z")]


@dataclass(frozen=True)
class JoinLimits:
    """The limits of one endpoint.

    Attributes:
        link_bytes: size of one message after zenoh's reassembly; zenoh drops a larger one. Twice the limit of a frame,
            so that a frame that is too large by mistake arrives and is counted.
        runners: runners of one run. A runner is a process of some 30 MB, so that a few machines cannot hold more.
        robots_per_runner: robots of one runner; a tick of so many fits into a frame many times.
        waiting: answers and requests of one runner in the world's queue. In lockstep the queue holds one, in real time
            a few; a runner that sends more sends answers that no frame asked for.
        waiting_bytes: bytes of these together; a single message of any size is accepted.
        flood: dropped messages of one runner; after these it is lost, and ignored for the rest of the run. To drop a
            message costs the world some 5 us, so that an endless sender would take a core.
        requests: requests for session info, or to join, of one runner in one run. A runner that comes back each minute
            for a day stays below.
        names: names of requesting or rate-limited runners in one run, each of which is stored; runners with further
            names are ignored. A runner that comes back under a new name each minute stays below for a month.
        join_s: time from the assignment of robots to the message that their agents are built.
    """

    link_bytes: int = 2 * MAX_BYTES
    runners: int = 2000
    robots_per_runner: int = 20_000
    waiting: int = 64
    waiting_bytes: int = 2 * MAX_BYTES
    flood: int = 5000
    requests: int = 2000
    names: int = 50_000
    join_s: float = 60.0


LIMITS = JoinLimits()  # the defaults


@dataclass(frozen=True)
class GroupInfo:
    """A group of robots and the agent of the scenario for them."""

    name: str
    agent: str  # as the scenario writes it: "package.module:Class" or "file.py:Class"
    agent_sha256: str  # of the file that defines the world's agent
    robots: int
    free: tuple[str, ...]  # robots without a runner


@dataclass(frozen=True)
class SessionInfo:
    """A run and its robots, as a world offers them to runners before they join."""

    run: str
    scenario: str  # its name
    scenario_sha256: str  # of its file; "" if it was made in Python
    swarmwire: str  # version of the world's package
    rate_hz: int
    real_time: float | None  # simulated seconds per second; None: as fast as the machines allow
    groups: tuple[GroupInfo, ...]

    def encode(self) -> bytes:
        """The session info as bytes."""
        return msgpack.packb({"v": frames.VERSION, **asdict(self)})

    def with_free(self, free: Mapping[str, list[str]]) -> "SessionInfo":
        """A copy with these free robots, by group."""
        return replace(
            self, groups=tuple(replace(group, free=tuple(free.get(group.name, ()))) for group in self.groups)
        )

    @classmethod
    def decode(cls, data: bytes) -> "SessionInfo":
        """The session info in these bytes; BadFrame if they hold none, "version" if they are of another version."""
        return typed(cls, versioned(data, frames.MAX_BYTES), "session info")  # with the names of all robots


@dataclass(frozen=True)
class JoinRequest:
    """A runner's request for robots, by number or by name; without either it gets the next free share.

    Attributes:
        robots: the number of robots; it gets the next free ones.
        names: the robots' names, as in the session info.
        agents: sha256 of the runner's agent by group; None: it runs another agent and proves nothing.
        scenario_sha256: of the expected scenario; None: any.
    """

    robots: Annotated[int, Meta(ge=1)] | None = None
    names: Annotated[tuple[str, ...], Meta(min_length=1)] | None = None
    agents: Mapping[str, Sha256] | None = None
    scenario_sha256: Sha256 | None = None

    def encode(self) -> bytes:
        """The request as bytes."""
        return msgpack.packb({"v": VERSION, **asdict(self)})

    @classmethod
    def decode(cls, data: bytes) -> "JoinRequest":
        """The request of these bytes; BadFrame if they are none, "version" if they are of another version."""
        request = typed(cls, versioned(data), "request")
        if request.robots is not None and request.names is not None:
            raise BadFrame("malformed", "expected robots or names, not both")
        return request


def versioned(data: bytes, max_bytes: int = MAX_JOIN_BYTES) -> dict[str, Any]:
    """The map in these bytes, of this version; BadFrame otherwise."""
    body = typed(dict[str, Any], unpacked(data, max_bytes), "message")
    version = body.get("v")
    if type(version) is not int or version != VERSION:
        raise BadFrame("version", f"expected version {VERSION} of the frames, got {version!r}")
    return body
