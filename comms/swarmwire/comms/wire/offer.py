"""What a world offers to runners before they join: msgpack, checked on arrival."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, cast

import msgpack

from swarmwire.comms.errors import BadFrame
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.join_request import versioned


@dataclass(frozen=True)
class OfferedGroup:
    """A group of robots and the agent that is to decide for them."""

    name: str
    agent: str  # as the scenario writes it: "package.module:Class" or "file.py:Class"
    agent_sha256: str  # of the file in which the world's own agent is defined
    robots: int
    free: tuple[str, ...]  # robots that nobody plays


@dataclass(frozen=True)
class Offer:
    """A run and what there is to play in it."""

    run: str
    scenario: str  # its name
    scenario_sha256: str  # of its file; "" if it was made in Python
    swarmwire: str  # version of the world's package
    rate_hz: int
    real_time: float | None  # simulated seconds per second; None: as fast as the machines allow
    groups: tuple[OfferedGroup, ...]

    def encode(self) -> bytes:
        """The offer as bytes."""
        return msgpack.packb({"v": frames.VERSION, **asdict(self)})

    def with_free(self, free: Mapping[str, list[str]]) -> "Offer":
        """The same, with these robots free, by group."""
        return replace(
            self, groups=tuple(replace(group, free=tuple(free.get(group.name, ()))) for group in self.groups)
        )

    @classmethod
    def decode(cls, data: bytes) -> "Offer":
        """The offer of these bytes; BadFrame if they are none, "version" if they are of another version."""
        told = versioned(data, frames.MOST_BYTES)  # with the names of all robots
        try:
            groups = tuple(_group(group) for group in told["groups"])
            factor = None if told["real_time"] is None else float(told["real_time"])
            return cls(**_typed(told, _OFFER), real_time=factor, groups=groups)
        except (KeyError, TypeError, ValueError) as error:
            raise BadFrame("malformed", f"expected an offer: {error}") from error


_OFFER: Mapping[str, type] = {"run": str, "scenario": str, "scenario_sha256": str, "swarmwire": str, "rate_hz": int}
_GROUP: Mapping[str, type] = {"name": str, "agent": str, "agent_sha256": str, "robots": int}


def _group(told: Any) -> OfferedGroup:
    free: Any = told["free"]
    if type(free) is not list or not all(type(name) is str for name in cast("list[object]", free)):
        raise TypeError("free is no list of texts")
    return OfferedGroup(**_typed(told, _GROUP), free=tuple(cast("list[str]", free)))


def _typed(told: Mapping[str, Any], of: Mapping[str, type]) -> dict[str, Any]:
    """The values of these names, each of its type; TypeError or KeyError otherwise."""
    for name, kind in of.items():
        if type(told[name]) is not kind:
            raise TypeError(f"{name} is no {kind.__name__}")
    return {name: told[name] for name in of}
