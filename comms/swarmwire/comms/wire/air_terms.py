"""What a driver-run robot learns when it joins the air of a world: msgpack, checked on arrival."""

from dataclasses import asdict, dataclass, fields
from typing import Any, cast

import msgpack
from msgpack.exceptions import UnpackException

from swarmwire.comms.errors import BadFrame
from swarmwire.comms.wire.frames import VERSION


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
        """The terms of these bytes; BadFrame if they are none."""
        try:
            found: object = msgpack.unpackb(data)
        except (ValueError, UnpackException) as error:
            raise BadFrame("malformed", f"no msgpack: {error}") from error
        if type(found) is not dict:
            raise BadFrame("malformed", "expected a map")
        values = cast("dict[str, Any]", found)
        if values.keys() != {"v", *(of.name for of in fields(cls))} or values.pop("v") != VERSION:
            raise BadFrame("malformed", f"expected the terms of an air, version {VERSION}")
        for name in ("row", "rate_hz", "max_payload_bytes"):
            if type(values[name]) is not int or values[name] < (name == "rate_hz"):
                raise BadFrame("malformed", f"{name}: expected a whole number")
        for name in ("robots", "gives", "needs"):
            texts = values[name]
            if type(texts) is not list or not all(type(text) is str for text in cast("list[object]", texts)):
                raise BadFrame("malformed", f"{name}: expected a list of texts")
            values[name] = tuple(cast("list[str]", texts))
        return cls(**values)
