"""Frames on the wire: msgpack maps of a version, a kind, a tick, named arrays and a few plain values.

Arrays are raw little-endian buffers. No number in a frame determines an allocation: the shape of an array must fit its
bytes. Other items are counted while they are unpacked, since a byte of msgpack may be a list or a map, which takes
seventy times as much memory.
"""

# Data from the network have unknown types until they are checked, item by item; a `cast` is a call, too slow here.
# pyright: reportUnknownVariableType=false, reportUnknownArgumentType=false, reportUnknownMemberType=false

from collections.abc import Mapping, Sized
from dataclasses import dataclass, field
from typing import Any, TypeVar

import msgpack
import msgspec
import numpy as np
from msgpack.exceptions import UnpackException

from swarmwire.comms.base.arrays import AnyArray
from swarmwire.comms.base.errors import BadFrame
from swarmwire.comms.wire.limits import MAX_BYTES

VERSION = 1  # version of the frames between world and runners, and of the messages before a runner joins
KEYS = {"v", "kind", "tick", "arrays", "values"}
DTYPES = {code: np.dtype(code) for code in ("<f8", "<i8", "<u8", "|b1", "|u1")}
BOOL = DTYPES["|b1"]
UNCOUNTED_BYTES = 64 * 1024  # unpacked size: a few MB at most; pragma: no mutate (only memory differs)
MAX_ITEMS = 500_000  # lists, maps and their items: some 40 MB

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Frame:
    """A frame; `kind` determines the meaning of its arrays and values."""

    kind: str
    tick: int
    arrays: Mapping[str, AnyArray]
    values: dict[str, Any] = field(default_factory=dict[str, Any])


def unpacked(data: bytes, max_bytes: int) -> Any:
    """Unpack msgpack; BadFrame "oversized" for too many bytes, "malformed" for too many items or other data."""
    if len(data) > max_bytes:
        raise BadFrame("oversized", f"{len(data)} bytes, expected at most {max_bytes}")
    try:
        return msgpack.unpackb(data) if len(data) <= UNCOUNTED_BYTES else _counted(data)
    except (ValueError, UnpackException) as error:
        raise BadFrame("malformed", f"no msgpack: {error}") from error


def typed(kind: type[T], value: object, key: str) -> T:
    """Convert maps, lists and plain values to an instance of a type; BadFrame if they do not fit it.

    The error names the path of the value, which begins with `key`, and the expectation. A dataclass ignores unknown
    keys, a `Struct` can refuse them. A boolean is no number; NaN is a number, unless the type has bounds.
    """
    try:
        return msgspec.convert(value, kind)
    except msgspec.ValidationError as error:
        fault, _, path = str(error).partition(" - at `$")
        raise BadFrame("malformed", f"{key}{path.rstrip('`')}: {fault[0].lower()}{fault[1:]}") from None


def _counted(data: bytes) -> Any:
    items = 0

    def count(container: Sized) -> Sized:
        nonlocal items
        items += 1 + len(container)
        if items > MAX_ITEMS:
            raise ValueError(f"more than {MAX_ITEMS} items")
        return container

    return msgpack.unpackb(data, list_hook=count, object_hook=count, max_array_len=MAX_ITEMS, max_map_len=MAX_ITEMS)


def encode(kind: str, tick: int, arrays: Mapping[str, AnyArray], values: Mapping[str, Any] | None = None) -> bytes:
    """Encode a frame; arrays must be of a dtype in `DTYPES`."""
    packed = {name: (array.dtype.str, array.shape, array.tobytes()) for name, array in arrays.items()}
    return msgpack.packb({"v": VERSION, "kind": kind, "tick": tick, "arrays": packed, "values": dict(values or {})})


def decode(data: bytes, max_bytes: int = MAX_BYTES) -> Frame:
    """Decode a frame; BadFrame ("oversized" or "malformed") for other bytes. Arrays are read-only views."""
    body = unpacked(data, max_bytes)
    # Plain `if`s without `match` or `cast`, for speed: in every tick a world decodes several arrays of each of hundreds
    # of runners, and a runner that shares two cores with other runners has cold caches in every step.
    if type(body) is not dict or body.keys() != KEYS:
        raise BadFrame("malformed", f"expected a map of {', '.join(sorted(KEYS))}")
    version, kind, tick, arrays, values = body["v"], body["kind"], body["tick"], body["arrays"], body["values"]
    if type(version) is not int or version != VERSION:
        raise BadFrame("malformed", f"version {version!r}, expected {VERSION}")
    if type(kind) is not str or type(tick) is not int or type(arrays) is not dict or type(values) is not dict:
        raise BadFrame("malformed", "expected kind to be a text, tick a number, arrays and values maps")
    for name in (*arrays, *values):
        if type(name) is not str:
            raise BadFrame("malformed", "expected names of arrays and values to be texts")
    return Frame(kind, tick, {name: _array(name, item) for name, item in arrays.items()}, values)


def _array(name: str, item: Any) -> AnyArray:
    if type(item) is list and len(item) == 3:
        code, shape, buffer = item
        dtype = DTYPES.get(code) if type(code) is str else None
        if dtype is not None and type(shape) is list and type(buffer) is bytes:
            array = _shaped(dtype, shape, buffer)
            if array is not None:
                return array
    raise BadFrame("malformed", f"array {name!r}: expected dtype, shape (one or two axes) and as many bytes")


def _shaped(dtype: np.dtype[Any], shape: list[Any], buffer: bytes) -> AnyArray | None:
    items = 1
    for length in shape:
        # Each length is bounded: an array of 0 x 2^63 has no bytes, but numpy refuses it.
        if type(length) is not int or not 0 <= length <= MAX_BYTES:
            return None
        items *= length
    axes = len(shape)
    if not 0 < axes < 3 or items * dtype.itemsize != len(buffer):
        return None
    if dtype is BOOL and buffer.translate(None, b"\x00\x01"):
        return None  # other bytes would make numpy's masks and counts wrong
    array = np.frombuffer(buffer, dtype)
    return array if axes == 1 else array.reshape(shape)


def checked_array(frame: Frame, name: str, code: str, shape: tuple[int | None, ...]) -> AnyArray:
    """Return an array of the frame; BadFrame unless it has this dtype and shape (None: any length)."""
    array = frame.arrays.get(name)
    if array is not None and array.dtype == DTYPES[code] and array.ndim == len(shape):
        for expected, length in zip(shape, array.shape, strict=True):
            if expected is not None and expected != length:
                break
        else:
            return array
    raise BadFrame("malformed", f"{name}: expected {code} of shape {shape}")
