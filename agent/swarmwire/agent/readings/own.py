"""Readings of senses of the user's own."""

from collections.abc import Mapping
from typing import Any


class OwnReading:
    """What a sense of the user's own reads: each of its fields is an attribute.

    For one robot a float, or (width,); for n robots (n,), or (n, width).
    """

    def __init__(self, sense: str, fields: Mapping[str, Any]) -> None:
        self._sense, self._fields = sense, fields

    def __getattr__(self, name: str) -> Any:
        """A field by its name."""
        if name.startswith("_") or name not in self._fields:
            raise AttributeError(f"the sense {self._sense} has the fields {', '.join(self._fields)}, not {name}")
        return self._fields[name]
