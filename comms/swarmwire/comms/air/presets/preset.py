"""A preset: a kind of radio as a table of a scenario's `[radio]`, with the source of its figures."""

from typing import Any, NamedTuple


class Preset(NamedTuple):
    """A kind of radio."""

    told: str  # what it is
    source: str  # of its figures
    radio: dict[str, Any]  # keys of [radio]
    otherwise: str = ""  # where it is other than what it is named after
