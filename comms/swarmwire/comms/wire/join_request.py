"""What a runner asks for when it joins: msgpack, checked on arrival."""

import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, cast

import msgpack

from swarmwire.comms.errors import BadFrame
from swarmwire.comms.wire.frames import VERSION
from swarmwire.comms.wire.unpacking import unpacked

MOST_BYTES = 1024 * 1024
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


def versioned(data: bytes, most_bytes: int = MOST_BYTES) -> dict[str, Any]:
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
