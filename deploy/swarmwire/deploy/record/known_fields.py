"""Fields of an object in a file, as its dataclass has them."""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any


def known_fields(kind: type[Any], found: Mapping[str, Any]) -> dict[str, Any]:
    """All fields of this dataclass; KeyError if one is missing. Others are passed over: added ones keep the format."""
    return {field.name: found[field.name] for field in fields(kind)}
