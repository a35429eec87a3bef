"""Values that JSON and msgpack hold, so that run folders and the wire can: numbers, texts, lists, tables of these."""

from collections.abc import Mapping
from math import isfinite
from typing import cast

from swarmwire.comms.errors import BadInput

LEAST, MOST = -(2**63), 2**64 - 1  # of whole numbers in msgpack


def check_plain(value: object, where: str, key: str) -> None:
    """Raise BadInput with `where` and the key within `key` of what is not plain: a date, a number like inf or 2^64."""
    if isinstance(value, Mapping):
        for name, item in cast("Mapping[object, object]", value).items():
            inner = f"{key}.{name}"
            if not isinstance(name, str):
                raise BadInput(where, inner, f"expected a text as the name of a key, got {name!r}")
            check_plain(item, where, inner)
    elif isinstance(value, list | tuple):
        for place, item in enumerate(cast("list[object]", value)):
            check_plain(item, where, f"{key}[{place}]")
    elif isinstance(value, float) and not isfinite(value):
        raise BadInput(where, key, f"expected a finite number, got {value!r}")
    elif isinstance(value, int) and not LEAST <= value <= MOST:
        raise BadInput(where, key, f"expected a whole number of 64 bits, got {value!r}")
    elif not isinstance(value, bool | int | float | str):
        raise BadInput(where, key, f"expected a number, text, true, false, list or table, got {value!r}")
