"""Fields of an object in a file, as the dataclass of today has them."""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any


def known_fields(kind: type[Any], found: Mapping[str, Any]) -> dict[str, Any]:
    """The fields that this dataclass has: a later swarmwire may have added others, which keeps the format."""
    names = {field.name for field in fields(kind)}
    return {name: value for name, value in found.items() if name in names}
