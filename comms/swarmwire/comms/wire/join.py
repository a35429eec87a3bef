"""How runners join a run: the session info that it offers, and the join request of a runner.

Session info and requests are msgpack maps, checked on arrival.
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
        return typed(cls, versioned(data, MAX_BYTES), "session info")  # with the names of all robots


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
