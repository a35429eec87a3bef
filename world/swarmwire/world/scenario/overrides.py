"""`--set path=value`: a value of a scenario given from outside, put at its place before the scenario is checked."""

import tomllib
from typing import Any, cast

from swarmwire.comms.config import from_toml
from swarmwire.comms.errors import BadInput


def put(mapping: dict[str, Any], text: str) -> str:
    """Set the value that an override names by its path, in which a number is a place in a list.

    The path of what is new with it. BadInput if there is no such place.
    """
    keys, value = _parsed(text)
    at: Any = mapping
    new = len(keys)  # keys that lead to what is new
    for depth, key in enumerate(keys):
        if isinstance(at, list):
            items = cast("list[Any]", at)
            if not key.isdecimal() or int(key) >= len(items):
                expected = f"expected a place in a list of {len(items)}, counted from 0"
                raise BadInput(f"--set {text}", ".".join(keys[: depth + 1]), expected)
            holder, index = cast(Any, items), int(key)
        elif isinstance(at, dict):
            holder, index = cast(Any, at), key
        else:
            raise BadInput(f"--set {text}", ".".join(keys[: depth + 1]), f"{'.'.join(keys[:depth])} holds no keys")
        if isinstance(at, dict) and key not in at:
            new = min(new, depth + 1)
        if depth == len(keys) - 1:
            holder[index] = value
        else:
            at = holder[index] if isinstance(at, list) else holder.setdefault(index, {})
    return ".".join(keys[:new])


def _parsed(text: str) -> tuple[list[str], Any]:
    path, equals, value = text.partition("=")
    keys = [key.strip() for key in path.split(".")]
    if not equals or not all(keys):
        raise BadInput(f"--set {text}", "", "expected path=value, such as robots.flock.count=30")
    try:
        found = from_toml(f"value = {value}")
    except tomllib.TOMLDecodeError:
        return keys, value.strip()
    return keys, found["value"] if len(found) == 1 else value
