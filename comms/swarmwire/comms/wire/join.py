"""Messages before a runner joins a run: the session info of the run, and the join request of the runner.

Both are msgpack maps, checked on arrival.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Annotated, Any

import msgpack
from msgspec import Meta

from swarmwire.comms.base.errors import BadFrame
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.frames import VERSION, typed, unpacked
from swarmwire.comms.wire.limits import MAX_BYTES

MAX_JOIN_BYTES = 1024 * 1024
Sha256 = Annotated[str, Meta(pattern=r"^[0-9a-f]{64}\Z")]


@dataclass(frozen=True)
class GroupInfo:
    """A group of robots, and the agent that the scenario names for it."""

    name: str
    agent: str  # "package.module:Class" or "file.py:Class", copied from the scenario
    agent_sha256: str  # hash of the file that defines the scenario's agent
    robots: int  # number of robots in the group
    free: tuple[str, ...]  # robots without a runner


@dataclass(frozen=True)
class SessionInfo:
    """A run and its robots, as the world announces them to runners before they join."""

    run: str
    scenario: str  # name of the scenario
    scenario_sha256: str  # hash of the scenario's file; "" for a scenario made in Python
    swarmwire: str  # version of the world's package
    rate_hz: int
    real_time: float | None  # simulated seconds per second; None: as fast as the machines allow
    groups: tuple[GroupInfo, ...]

    def encode(self) -> bytes:
        """Encode the session info."""
        return msgpack.packb({"v": frames.VERSION, **asdict(self)})

    def with_free(self, free: Mapping[str, list[str]]) -> "SessionInfo":
        """Return a copy with these free robots, by group."""
        return replace(
            self, groups=tuple(replace(group, free=tuple(free.get(group.name, ()))) for group in self.groups)
        )

    @classmethod
    def decode(cls, data: bytes) -> "SessionInfo":
        """Decode session info; BadFrame if the bytes hold none, "version" if they are of another version."""
        return typed(cls, versioned(data, MAX_BYTES), "session info")  # large: it has the names of all robots


@dataclass(frozen=True)
class JoinRequest:
    """A runner's request for robots, by number or by name; a request with neither gets the next free share.

    Attributes:
        robots: number of robots; the runner gets the next free robots.
        names: names of robots in the session info.
        agents: sha256 of the runner's agent by group; None: it runs another agent and proves nothing.
        scenario_sha256: sha256 of the expected scenario; None: any scenario.
    """

    robots: Annotated[int, Meta(ge=1)] | None = None
    names: Annotated[tuple[str, ...], Meta(min_length=1)] | None = None
    agents: Mapping[str, Sha256] | None = None
    scenario_sha256: Sha256 | None = None

    def encode(self) -> bytes:
        """Encode the request."""
        return msgpack.packb({"v": VERSION, **asdict(self)})

    @classmethod
    def decode(cls, data: bytes) -> "JoinRequest":
        """Decode a request; BadFrame if the bytes hold none, "version" if they are of another version."""
        request = typed(cls, versioned(data), "request")
        if request.robots is not None and request.names is not None:
            raise BadFrame("malformed", "expected robots or names, not both")
        return request


def versioned(data: bytes, max_bytes: int = MAX_JOIN_BYTES) -> dict[str, Any]:
    """Unpack a map of this version; BadFrame for other bytes."""
    body = typed(dict[str, Any], unpacked(data, max_bytes), "message")
    version = body.get("v")
    if type(version) is not int or version != VERSION:
        raise BadFrame("version", f"expected version {VERSION} of the frames, got {version!r}")
    return body
