"""A class of the user's own that the program makes instances of: found, and known to be of the kind that is wanted."""

from dataclasses import is_dataclass
from typing import TypeVar, cast

from swarmwire.comms.errors import BadInput
from swarmwire.comms.loading import NotLoaded, load_named

K = TypeVar("K")


def own_class(base: type[K], spec: str, where: str, key: str) -> type[K]:
    """The whole dataclass below `base` that a spec names, as `load_named` reads it; else BadInput at `key`."""
    try:
        found = load_named(spec)
    except NotLoaded as error:
        raise BadInput(where, key, str(error)) from error
    if not isinstance(found, type) or not issubclass(found, base) or not is_dataclass(found):
        got = f"{spec} is {cast('object', found)!r}"
        raise BadInput(where, key, f"expected a dataclass below {base.__name__}; {got}")
    missing: frozenset[str] = getattr(found, "__abstractmethods__", frozenset())
    if missing:
        raise BadInput(where, key, f"{found.__name__} has no {', '.join(sorted(missing))}")
    return found
