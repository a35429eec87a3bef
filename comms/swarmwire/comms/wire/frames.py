"""Frames: msgpack maps of a version, a kind, a tick, named arrays as raw little-endian buffers, and a few plain values.

Nothing is allocated from a number that the frame claims: the bytes are there, and every array must fit its own bytes.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, cast

import msgpack
import numpy as np
from msgpack.exceptions import UnpackException

from swarmwire.comms.arrays import AnyArray
from swarmwire.comms.errors import BadFrame

VERSION = 1
MOST_BYTES = 64 * 1024 * 1024
DTYPES = {code: np.dtype(code) for code in ("<f8", "<i8", "<u8", "|b1", "|u1")}


@dataclass(frozen=True, slots=True)
class Frame:
    """One frame: `kind` says what its arrays and values mean."""

    kind: str
    tick: int
    arrays: Mapping[str, AnyArray]
    values: dict[str, Any] = field(default_factory=dict[str, Any])


def encode(kind: str, tick: int, arrays: Mapping[str, AnyArray], values: Mapping[str, Any] | None = None) -> bytes:
    """The bytes of a frame; arrays must be of a dtype in `DTYPES`."""
    packed = {name: (array.dtype.str, array.shape, array.tobytes()) for name, array in arrays.items()}
    return msgpack.packb({"v": VERSION, "kind": kind, "tick": tick, "arrays": packed, "values": dict(values or {})})


def decode(data: bytes, most_bytes: int = MOST_BYTES) -> Frame:
    """The frame of these bytes; BadFrame ("oversized" or "malformed") if they are none. Arrays are read-only views."""
    if len(data) > most_bytes:
        raise BadFrame("oversized", f"{len(data)} bytes, expected at most {most_bytes}")
    try:
        body: object = msgpack.unpackb(data)
    except (ValueError, UnpackException) as error:
        raise BadFrame("malformed", f"no msgpack: {error}") from error
    match body:
        case {"v": int(version), "kind": str(kind), "tick": int(tick), "arrays": dict(), "values": dict()}:
            if version != VERSION:
                raise BadFrame("malformed", f"version {version}, expected {VERSION}")
            whole = cast("dict[str, dict[str, Any]]", body)
            arrays = {name: _array(name, item) for name, item in whole["arrays"].items()}
            return Frame(kind, tick, arrays, whole["values"])
        case _:
            raise BadFrame("malformed", "expected a map of v, kind, tick, arrays and values")


def _array(name: str, item: object) -> AnyArray:
    match item:
        case [str(code), list(), bytes(buffer)] if code in DTYPES:
            shape = cast("list[object]", item[1])
            lengths = [length for length in shape if type(length) is int and length >= 0]
            fits = len(lengths) == len(shape) <= 3 and math.prod(lengths) * DTYPES[code].itemsize == len(buffer)
            if fits:
                return np.frombuffer(buffer, DTYPES[code]).reshape(lengths)
        case _:
            pass
    raise BadFrame("malformed", f"array {name!r}: expected dtype, shape and as many bytes")
