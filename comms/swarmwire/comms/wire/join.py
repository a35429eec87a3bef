"""What a run takes from others at most; all beyond it is refused or dropped, and counted where it reaches the world.

They bound what one runner that is admitted can do to the memory of a world and to the other runners. They do not bound
its share of the machine: docs/security.md says what that means.
"""

import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, cast

import msgpack

from swarmwire.comms.errors import BadFrame
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.frames import MAX_BYTES, VERSION, unpacked


@dataclass(frozen=True)
class JoinLimits:
    """The limits of one endpoint.

    Attributes:
        link_bytes: of one message, as zenoh puts it together again from its parts; a larger one vanishes there. Twice
            what a frame may have, so that a frame that is too large by mistake arrives, and is counted.
        runners: of one run. A runner is a process with some 30 MB, so that more do not fit on a few machines.
        robots_per_runner: that one runner may play; a tick of so many fits into a frame many times.
        waiting: answers and requests of one runner that wait for the world. In lockstep one is there at a time, in
            real time a few; a runner that sends more is ahead of anything that it was asked.
        waiting_bytes: of these together; one is taken, however large.
        flood: that may be dropped of one runner; then it is lost, and received no more in this run. Even to drop a
        message
            costs the world some 5 us, so that one that never stops would take a core.
        requests: to be told of the run, or to join it, that one runner may make in one run. A runner that comes back
            each minute for a day stays below.
        names: of runners that ask for something or send too much, in one run, each of which is remembered; beyond them
            nobody new is received. A runner that comes back under a new name each minute stays below for a month.
        join_s: from the assignment of robots to the word that their agents are built.
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


LIMITS = JoinLimits()  # of every world that is not told others


# --- What a world offers to runners before they join: msgpack, checked on arrival.


@dataclass(frozen=True)
class GroupInfo:
    """A group of robots and the agent that is to decide for them."""

    name: str
    agent: str  # as the scenario writes it: "package.module:Class" or "file.py:Class"
    agent_sha256: str  # of the file in which the world's own agent is defined
    robots: int
    free: tuple[str, ...]  # robots that nobody plays


@dataclass(frozen=True)
class SessionInfo:
    """A run and what there is to play in it."""

    run: str
    scenario: str  # its name
    scenario_sha256: str  # of its file; "" if it was made in Python
    swarmwire: str  # version of the world's package
    rate_hz: int
    real_time: float | None  # simulated seconds per second; None: as fast as the machines allow
    groups: tuple[GroupInfo, ...]

    def encode(self) -> bytes:
        """The offer as bytes."""
        return msgpack.packb({"v": frames.VERSION, **asdict(self)})

    def with_free(self, free: Mapping[str, list[str]]) -> "SessionInfo":
        """The same, with these robots free, by group."""
        return replace(
            self, groups=tuple(replace(group, free=tuple(free.get(group.name, ()))) for group in self.groups)
        )

    @classmethod
    def decode(cls, data: bytes) -> "SessionInfo":
        """The offer of these bytes; BadFrame if they are none, "version" if they are of another version."""
        told = versioned(data, frames.MAX_BYTES)  # with the names of all robots
        try:
            groups = tuple(_group(group) for group in told["groups"])
            factor = None if told["real_time"] is None else float(told["real_time"])
            return cls(**_typed(told, _OFFER), real_time=factor, groups=groups)
        except (KeyError, TypeError, ValueError) as error:
            raise BadFrame("malformed", f"expected an offer: {error}") from error


_OFFER: Mapping[str, type] = {"run": str, "scenario": str, "scenario_sha256": str, "swarmwire": str, "rate_hz": int}
_GROUP: Mapping[str, type] = {"name": str, "agent": str, "agent_sha256": str, "robots": int}


def _group(told: Any) -> GroupInfo:
    free: Any = told["free"]
    if type(free) is not list or not all(type(name) is str for name in cast("list[object]", free)):
        raise TypeError("free is no list of texts")
    return GroupInfo(**_typed(told, _GROUP), free=tuple(cast("list[str]", free)))


def _typed(told: Mapping[str, Any], of: Mapping[str, type]) -> dict[str, Any]:
    """The values of these names, each of its type; TypeError or KeyError otherwise."""
    for name, kind in of.items():
        if type(told[name]) is not kind:
            raise TypeError(f"{name} is no {kind.__name__}")
    return {name: told[name] for name in of}


# --- What a runner asks for when it joins: msgpack, checked on arrival.


MAX_JOIN_BYTES = 1024 * 1024
SHA256 = re.compile(r"[0-9a-f]{64}", re.ASCII)


@dataclass(frozen=True)
class JoinRequest:
    """Robots that a runner asks for: so many, or named ones; neither: the next part that is free.

    Attributes:
        robots: how many, the next ones that are free.
        names: of the robots, as the offer tells them.
        agents: sha256 of the runner's own agent by group; None: it plays with code of its own and proves nothing.
        scenario_sha256: of the scenario that it expects; None: any.
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
        asked = versioned(data)
        robots, names, agents = asked.get("robots"), asked.get("names"), cast("object", asked.get("agents"))
        scenario: object = asked.get("scenario_sha256")
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
        given = None if names is None else tuple(cast("list[str]", names))
        return cls(robots, given, cast("dict[str, str] | None", agents), scenario)


def versioned(data: bytes, most_bytes: int = MAX_JOIN_BYTES) -> dict[str, Any]:
    """The map of these bytes, of this version; BadFrame otherwise."""
    found: object = unpacked(data, most_bytes)
    if type(found) is not dict or not _texts([*cast("dict[object, object]", found)]):
        raise BadFrame("malformed", "expected a map")
    version = cast("dict[str, object]", found).get("v")
    if type(version) is not int or version != VERSION:
        raise BadFrame("version", f"expected version {VERSION} of the frames, got {version!r}")
    return cast("dict[str, Any]", found)


def _texts(items: list[object]) -> bool:
    return all(type(item) is str for item in items)


def _hashes(by_group: dict[object, object]) -> bool:
    return _texts([*by_group]) and all(isinstance(of, str) and SHA256.fullmatch(of) for of in by_group.values())
