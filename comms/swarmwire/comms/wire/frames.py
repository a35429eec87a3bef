"""Msgpack from elsewhere: what it becomes takes no more memory than its bytes allow for.

A byte of msgpack may be a list or a map, which takes seventy times as much here; so these are counted as they appear.
"""

# pyright: reportUnknownVariableType=false, reportUnknownArgumentType=false, reportUnknownMemberType=false

from collections.abc import Mapping, Sized
from dataclasses import dataclass, field
from typing import Any

import msgpack
import numpy as np
from msgpack.exceptions import UnpackException

from swarmwire.comms.arrays import AnyArray
from swarmwire.comms.errors import BadFrame

# What arrives is of unknown types until it is checked.


UNCOUNTED_BYTES = 64 * 1024  # become a few MB at most; pragma: no mutate (only memory differs)
MAX_ITEMS = 500_000  # lists, maps and what is in them: some 40 MB; of a frame's arrays each is one


def unpacked(data: bytes, most_bytes: int) -> Any:
    """What these bytes are; BadFrame ("oversized" or "malformed") if they are too many, hold too much, or are none."""
    if len(data) > most_bytes:
        raise BadFrame("oversized", f"{len(data)} bytes, expected at most {most_bytes}")
    try:
        return msgpack.unpackb(data) if len(data) <= UNCOUNTED_BYTES else _counted(data)
    except (ValueError, UnpackException) as error:
        raise BadFrame("malformed", f"no msgpack: {error}") from error


def _counted(data: bytes) -> Any:
    items = 0

    def count(found: Sized) -> Sized:
        nonlocal items
        items += 1 + len(found)
        if items > MAX_ITEMS:
            raise ValueError(f"more than {MAX_ITEMS} items")
        return found

    return msgpack.unpackb(data, list_hook=count, object_hook=count, max_array_len=MAX_ITEMS, max_map_len=MAX_ITEMS)


# --- Frames: msgpack maps of a version, a kind, a tick, named arrays as raw little-endian buffers, and a few plain
# values.
#
# Nothing is allocated from a number that the frame claims: the bytes are there, and every array must fit its own bytes.
# What else is in a frame is counted while it is unpacked.


# What arrives is of unknown types until it is checked, item by item; a `cast` is a call, here in the busiest of loops.


VERSION = 1  # of frames between world and runners, and of what runners ask before
KEYS = {"v", "kind", "tick", "arrays", "values"}
MAX_BYTES = 64 * 1024 * 1024  # of a frame
DTYPES = {code: np.dtype(code) for code in ("<f8", "<i8", "<u8", "|b1", "|u1")}
TRUTHS = DTYPES["|b1"]


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


def decode(data: bytes, most_bytes: int = MAX_BYTES) -> Frame:
    """The frame of these bytes; BadFrame ("oversized" or "malformed") if they are none. Arrays are read-only views."""
    body = unpacked(data, most_bytes)
    # Written out by hand, not with `match` or `cast`, here and below: a world decodes some arrays from each of hundreds
    # of runners in every tick, and a runner that shares two cores with them finds its caches cold for every step.
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
        # Each length is bounded, too: 0 x 2^63 holds nothing, and yet numpy has no such array.
        if type(length) is not int or not 0 <= length <= MAX_BYTES:
            return None
        items *= length
    axes = len(shape)
    if not 0 < axes < 3 or items * dtype.itemsize != len(buffer):
        return None
    if dtype is TRUTHS and buffer.translate(None, b"\x00\x01"):
        return None  # numpy masks and counts wrongly with any other byte
    array = np.frombuffer(buffer, dtype)
    return array if axes == 1 else array.reshape(shape)


# --- Arrays of a frame that came over the wire, checked before they are used.


def checked_array(frame: Frame, name: str, code: str, shape: tuple[int | None, ...]) -> AnyArray:
    """An array of the frame, of this dtype and shape (None: any length); BadFrame otherwise."""
    array = frame.arrays.get(name)
    if array is not None and array.dtype == DTYPES[code] and array.ndim == len(shape):
        for want, got in zip(shape, array.shape, strict=True):
            if want is not None and want != got:
                break
        else:
            return array
    raise BadFrame("malformed", f"{name}: expected {code} of shape {shape}")
