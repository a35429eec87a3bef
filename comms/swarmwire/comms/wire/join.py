"""How runners join a run: its limits, the session info that it offers, and the join request of a runner.

Session info and requests are msgpack maps, checked on arrival. The limits bound the effect of one admitted runner on
the memory of a world and on the other runners: messages beyond them are refused or dropped, and counted where they
reach the world. They do not bound the runner's share of the machine: see docs/security.md.
"""

import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, cast

import msgpack

from swarmwire.comms.errors import BadFrame
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.frames import MAX_BYTES, VERSION, unpacked

MAX_JOIN_BYTES = 1024 * 1024
SHA256 = re.compile(r"[0-9a-f]{64}", re.ASCII)


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
        waiting_bytes: bytes of these together; one message is accepted whatever its size.
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
        values = versioned(data, frames.MAX_BYTES)  # with the names of all robots
        try:
            groups = tuple(_group(group) for group in values["groups"])
            factor = None if values["real_time"] is None else float(values["real_time"])
            return cls(**_typed(values, _SESSION_TYPES), real_time=factor, groups=groups)
        except (KeyError, TypeError, ValueError) as error:
            raise BadFrame("malformed", f"expected an offer: {error}") from error


_SESSION_TYPES: Mapping[str, type] = {
    "run": str,
    "scenario": str,
    "scenario_sha256": str,
    "swarmwire": str,
    "rate_hz": int,
}
_GROUP_TYPES: Mapping[str, type] = {"name": str, "agent": str, "agent_sha256": str, "robots": int}


def _group(values: Any) -> GroupInfo:
    free: Any = values["free"]
    if type(free) is not list or not all(type(name) is str for name in cast("list[object]", free)):
        raise TypeError("free is no list of texts")
    return GroupInfo(**_typed(values, _GROUP_TYPES), free=tuple(cast("list[str]", free)))


def _typed(values: Mapping[str, Any], types: Mapping[str, type]) -> dict[str, Any]:
    """The values of these names, each of its type; TypeError or KeyError otherwise."""
    for name, kind in types.items():
        if type(values[name]) is not kind:
            raise TypeError(f"{name} is no {kind.__name__}")
    return {name: values[name] for name in types}


@dataclass(frozen=True)
class JoinRequest:
    """A runner's request for robots, by number or by name; without either it gets the next free share.

    Attributes:
        robots: the number of robots; it gets the next free ones.
        names: the robots' names, as in the session info.
        agents: sha256 of the runner's agent by group; None: it runs another agent and proves nothing.
        scenario_sha256: of the expected scenario; None: any.
    """

    robots: int | None = None
    names: tuple[str, ...] | None = None
    agents: Mapping[str, str] | None = None
    scenario_sha256: str | None = None

    def encode(self) -> bytes:
        """The request as bytes."""
        return msgpack.packb({"v": VERSION, **asdict(self)})

    @classmethod
    def decode(cls, data: bytes) -> "JoinRequest":
        """The request of these bytes; BadFrame if they are none, "version" if they are of another version."""
        values = versioned(data)
        robots, names, agents = values.get("robots"), values.get("names"), cast("object", values.get("agents"))
        scenario: object = values.get("scenario_sha256")
        if robots is not None and (type(robots) is not int or robots < 1):
            raise BadFrame("malformed", "robots: expected a number of at least 1")
        if names is not None and not (type(names) is list and names and _texts(cast("list[object]", names))):
            raise BadFrame("malformed", "names: expected a list of names of robots")
        if robots is not None and names is not None:
            raise BadFrame("malformed", "expected robots or names, not both")
        if agents is not None and (type(agents) is not dict or not _hashes(cast("dict[object, object]", agents))):
            raise BadFrame("malformed", "agents: expected the sha256 of an agent by group")
        if scenario is not None and not (isinstance(scenario, str) and SHA256.fullmatch(scenario)):
            raise BadFrame("malformed", "scenario_sha256: expected 64 hexadecimal digits")
        robot_names = None if names is None else tuple(cast("list[str]", names))
        return cls(robots, robot_names, cast("dict[str, str] | None", agents), scenario)


def versioned(data: bytes, max_bytes: int = MAX_JOIN_BYTES) -> dict[str, Any]:
    """The map in these bytes, of this version; BadFrame otherwise."""
    body: object = unpacked(data, max_bytes)
    if type(body) is not dict or not _texts([*cast("dict[object, object]", body)]):
        raise BadFrame("malformed", "expected a map")
    version = cast("dict[str, object]", body).get("v")
    if type(version) is not int or version != VERSION:
        raise BadFrame("version", f"expected version {VERSION} of the frames, got {version!r}")
    return cast("dict[str, Any]", body)


def _texts(items: list[object]) -> bool:
    return all(type(item) is str for item in items)


def _hashes(by_group: dict[object, object]) -> bool:
    return _texts([*by_group]) and all(
        isinstance(hash_, str) and SHA256.fullmatch(hash_) for hash_ in by_group.values()
    )
