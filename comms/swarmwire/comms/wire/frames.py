"""Frames: msgpack maps of a version, a kind, a tick, named arrays as raw little-endian buffers, and a few plain values.

Nothing is allocated from a number that the frame claims: the bytes are there, and every array must fit its own bytes.
"""

from collections.abc import Container, Mapping
from dataclasses import dataclass, field
from typing import Any, cast

import msgpack
import numpy as np
from msgpack.exceptions import UnpackException

from swarmwire.comms.arrays import AnyArray
from swarmwire.comms.errors import BadFrame

VERSION = 2  # of frames between world and runners, and of what runners ask before
KEYS = {"v", "kind", "tick", "arrays", "values"}
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


def decode(data: bytes, most_bytes: int = MOST_BYTES, versions: Container[int] = (VERSION,)) -> Frame:
    """The frame of these bytes; BadFrame ("oversized" or "malformed") if they are none. Arrays are read-only views."""
    if len(data) > most_bytes:
        raise BadFrame("oversized", f"{len(data)} bytes, expected at most {most_bytes}")
    try:
        body: object = msgpack.unpackb(data)
    except (ValueError, UnpackException) as error:
        raise BadFrame("malformed", f"no msgpack: {error}") from error
    # Written out by hand, not with `match`, here and below: a world decodes ten arrays from each of a hundred runners
    # in every tick.
    if type(body) is not dict or cast("dict[object, object]", body).keys() != KEYS:
        raise BadFrame("malformed", f"expected a map of {', '.join(sorted(KEYS))}")
    whole = cast("dict[str, Any]", body)
    version, kind, tick, arrays, values = whole["v"], whole["kind"], whole["tick"], whole["arrays"], whole["values"]
    if type(version) is not int or version not in versions:
        raise BadFrame("malformed", f"version {version!r}, expected {VERSION}")
    if type(kind) is not str or type(tick) is not int or type(arrays) is not dict or type(values) is not dict:
        raise BadFrame("malformed", "expected kind to be a text, tick a number, arrays and values maps")
    named = cast("dict[object, object]", arrays)
    if not all(type(name) is str for name in (*named, *cast("dict[object, object]", values))):
        raise BadFrame("malformed", "expected names of arrays and values to be texts")
    decoded = {cast(str, name): _array(name, item) for name, item in named.items()}
    return Frame(kind, tick, decoded, cast("dict[str, Any]", values))


def _array(name: object, item: object) -> AnyArray:
    if type(item) is list and len(cast("list[object]", item)) == 3:
        code, shape, buffer = cast("tuple[object, object, object]", item)
        dtype = DTYPES.get(code) if type(code) is str else None
        if dtype is not None and type(shape) is list and type(buffer) is bytes:
            array = _shaped(dtype, cast("list[object]", shape), buffer)
            if array is not None:
                return array
    raise BadFrame("malformed", f"array {name!r}: expected dtype, shape (one or two axes) and as many bytes")


def _shaped(dtype: np.dtype[Any], shape: list[object], buffer: bytes) -> AnyArray | None:
    rows = shape[0] if shape else None
    # Each length is bounded, too: 0 x 2^63 holds nothing, and yet numpy has no such array.
    if type(rows) is not int or not 0 <= rows <= MOST_BYTES:
        return None
    if dtype.kind == "b" and buffer.translate(None, b"\x00\x01"):
        return None  # numpy masks and counts wrongly with any other byte
    if len(shape) == 1:
        return np.frombuffer(buffer, dtype) if rows * dtype.itemsize == len(buffer) else None
    columns = shape[1]
    if len(shape) > 2 or type(columns) is not int or not 0 <= columns <= MOST_BYTES:
        return None
    if rows * columns * dtype.itemsize != len(buffer):
        return None
    return np.frombuffer(buffer, dtype).reshape(rows, columns)
