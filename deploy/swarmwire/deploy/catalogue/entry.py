"""What the catalogue tells of a thing that has a name."""

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Parameter:
    """One value that a thing has or takes."""

    name: str  # a path within the thing: "response.reach_m"; `*` is the name of a group or the place in a list
    help: str
    unit: str = ""
    value: Any = None  # the default, or the figure of a data sheet; None: there is none
    required: bool = False  # it must be given
    expected: str = ""  # which values it may take, in words


@dataclass(frozen=True)
class ParameterTable:
    """Parameters under one title, and what their `value` is: "default" or "value"."""

    title: str
    parameters: tuple[Parameter, ...]
    value_is: str = "default"


@dataclass(frozen=True)
class Entry:
    """One thing that has a name."""

    kind: str  # as in `kind:name`: "body", "metric", …
    name: str
    help: str  # one line
    facts: tuple[tuple[str, str], ...] = ()  # title and text: its unit, its source, how a scenario names it, …
    tables: tuple[ParameterTable, ...] = ()
    mark: str = ""  # a word that lists show beside the name: "standard"
    text: str = ""  # paragraphs with an empty line between two
