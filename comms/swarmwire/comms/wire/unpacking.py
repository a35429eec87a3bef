"""Msgpack from elsewhere: what it becomes takes no more memory than its bytes allow for.

A byte of msgpack may be a list or a map, which takes seventy times as much here; so these are counted as they appear.
"""

# What arrives is of unknown types until it is checked.
# pyright: reportUnknownVariableType=false, reportUnknownArgumentType=false

from collections.abc import Sized
from typing import Any

import msgpack
from msgpack.exceptions import UnpackException

from swarmwire.comms.errors import BadFrame

UNCOUNTED_BYTES = 64 * 1024  # become a few MB at most; pragma: no mutate (only memory differs)
MOST_ITEMS = 500_000  # lists, maps and what is in them: some 40 MB; of a frame's arrays each is one


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
        if items > MOST_ITEMS:
            raise ValueError(f"more than {MOST_ITEMS} items")
        return found

    return msgpack.unpackb(data, list_hook=count, object_hook=count, max_array_len=MOST_ITEMS, max_map_len=MOST_ITEMS)
