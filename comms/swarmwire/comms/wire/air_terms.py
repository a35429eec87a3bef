"""What a driver-run robot learns when it joins the air of a world: msgpack, checked on arrival."""

from dataclasses import asdict, dataclass, fields
from typing import cast

import msgpack

from swarmwire.comms.errors import BadFrame
from swarmwire.comms.wire.frames import MOST_BYTES, VERSION
from swarmwire.comms.wire.join_request import versioned


@dataclass(frozen=True, slots=True)
class AirTerms:
    """A radio of the world as one robot knows it."""

    row: int  # the robot's, in the world
    robots: tuple[str, ...]  # all robots of its arena, by index
    rate_hz: int  # ticks of the world per second
    max_payload_bytes: int
    gives: tuple[str, ...]  # columns of `Heard.given`
    needs: tuple[str, ...]  # what of an agent's needs it meets

    def encode(self) -> bytes:
        """The terms as bytes."""
        return msgpack.packb({"v": VERSION, **asdict(self)})

    @classmethod
    def decode(cls, data: bytes) -> "AirTerms":
        """The terms of these bytes; BadFrame if they are none, "version" if they are of another version."""
        values = versioned(data, MOST_BYTES)  # with the names of all robots
        del values["v"]
        if values.keys() != {of.name for of in fields(cls)}:
            raise BadFrame("malformed", "expected the terms of an air")
        for name in ("row", "rate_hz", "max_payload_bytes"):
            if type(values[name]) is not int or values[name] < (name == "rate_hz"):
                raise BadFrame("malformed", f"{name}: expected a whole number")
        for name in ("robots", "gives", "needs"):
            texts = values[name]
            if type(texts) is not list or not all(type(text) is str for text in cast("list[object]", texts)):
                raise BadFrame("malformed", f"{name}: expected a list of texts")
            values[name] = tuple(cast("list[str]", texts))
        return cls(**values)
