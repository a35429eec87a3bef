"""Parameters as frozen dataclasses whose fields carry unit, bounds and a line of help in their metadata."""

import json
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, Field, dataclass, field
from difflib import get_close_matches
from enum import IntEnum
from math import isfinite
from pathlib import Path
from typing import Any, Self, cast

from swarmwire.comms.errors import BadInput


@dataclass(frozen=True, slots=True)
class Bounds:
    """What a parameter means and which values it may take (bounds are inclusive unless they start with `above`)."""

    help: str
    unit: str = ""
    at_least: float | None = None
    at_most: float | None = None
    above: float | None = None
    below: float | None = None
    choices: tuple[str, ...] = ()


def parameter(
    default: Any = MISSING,
    *,
    help: str,  # noqa: A002 - the word that users of dataclasses, typer and argparse know
    unit: str = "",
    at_least: float | None = None,
    at_most: float | None = None,
    above: float | None = None,
    below: float | None = None,
    choices: tuple[str, ...] = (),
) -> Any:
    """A dataclass field with a `Limits` in its metadata; without default the value must be given."""
    limits = Bounds(help, unit, at_least, at_most, above, below, choices)
    return field(default=default, metadata={"limits": limits})


def bounds_of(of: "Field[Any]") -> Bounds:
    """The limits of a dataclass field made by `parameter` (empty ones for any other field)."""
    found = of.metadata.get("limits")
    return found if isinstance(found, Bounds) else Bounds(help="")


def fault_of(value: float, limits: Bounds) -> str | None:
    """What was expected of `value`, in words, or None if it is within its limits.

    >>> fault_of(-1.0, Limits("how long it lasts", unit="s", above=0.0))
    'expected more than 0 s, got -1.0'
    """
    unit = f" {limits.unit}" if limits.unit else ""
    if limits.at_least is not None and not value >= limits.at_least:
        return f"expected at least {limits.at_least:g}{unit}, got {value!r}"
    if limits.at_most is not None and not value <= limits.at_most:
        return f"expected at most {limits.at_most:g}{unit}, got {value!r}"
    if limits.above is not None and not value > limits.above:
        return f"expected more than {limits.above:g}{unit}, got {value!r}"
    if limits.below is not None and not value < limits.below:
        return f"expected less than {limits.below:g}{unit}, got {value!r}"
    return None


@dataclass(frozen=True)
class NoParameters:
    """Parameters of what has none."""


# --- Enumerations whose members say what they mean.


class ExplainedEnum(IntEnum):
    """Integers, each with its meaning: `NAME = 0, "what it means"`."""

    meaning: str

    def __new__(cls, value: int, meaning: str) -> Self:
        """The member of this number."""
        member = int.__new__(cls, value)
        member._value_ = value
        member.meaning = meaning
        return member


# --- The names that there are, in words: for errors about one that there is not.


def did_you_mean(known: Iterable[str], given: object = None) -> str:
    """The words "one of a, b, c", and which of these was probably meant, if what was `given` is near one of them.

    >>> one_of(["range_m", "loss"], "range")
    'one of range_m, loss (did you mean range_m?)'
    """
    names = list(known)
    if not names:
        return "none"
    near = get_close_matches(given, names, n=1) if isinstance(given, str) else []
    return f"one of {', '.join(names)}" + "".join(f" (did you mean {name}?)" for name in near)


# --- JSON and TOML of users and of disks that lie: whatever is wrong with a text is a ValueError.


TOO_DEEP = "lists or tables within one another, too many to be meant"


def from_json(text: str | bytes) -> Any:
    """What the text says; ValueError if it is no JSON, also where Python's own reader gives up."""
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError(TOO_DEEP) from None


def from_toml(text: str) -> dict[str, Any]:
    """The table that the text says; `tomllib.TOMLDecodeError` if it is no TOML, also where Python's reader gives up."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        raise
    except RecursionError:
        raise tomllib.TOMLDecodeError(TOO_DEEP) from None
    except ValueError as error:  # a number of thousands of digits, a date that there is not
        raise tomllib.TOMLDecodeError(str(error)) from None


# --- Values that JSON and msgpack hold, so that run folders and the wire can: numbers, texts, lists, tables of these.


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


# --- The version that a file names as its `format`: any other one, or none, is refused in one line.


KEY = "format"


def check_format(content: object, known: int, where: str) -> None:
    """Return if the table in a file names the known format; BadInput if it names another one, or none.

    Called before anything else of the file is read, since other formats may have other keys. Content that is no table
    is left to the reader of the rest.

    >>> check_format({"format": 1}, 1, "a.toml")
    >>> check_format({"format": 2}, 1, "a.toml")
    Traceback (most recent call last):
    swarmwire.comms.errors.BadInput: a.toml: format: expected 1, got 2: made by a newer swarmwire; upgrade to read it
    >>> check_format({}, 1, "a.toml")
    Traceback (most recent call last):
    swarmwire.comms.errors.BadInput: a.toml: format: is missing: expected 1
    """
    if not isinstance(content, Mapping):
        return
    table = cast("Mapping[str, object]", content)
    if KEY not in table:
        raise BadInput(where, KEY, f"is missing: expected {known}")
    found = table[KEY]
    if type(found) is int and found == known:
        return
    if type(found) is int and found > known:
        whose = ": made by a newer swarmwire; upgrade to read it"
    elif type(found) is int and found > 0:
        whose = ": made by an older swarmwire; that one reads it"
    else:
        whose = ""
    raise BadInput(where, KEY, f"expected {known}, got {found!r}{whose}")


# --- TOML files of users, read or refused in one line.


def read_toml(path: Path, named_by: tuple[str, str] | None = None) -> dict[str, Any]:
    """The content of a file; BadInput if it cannot be read.

    A file that another one names, `named_by` as (file, key), is refused there if it is missing.
    """
    try:
        return from_toml(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        if named_by is not None:
            raise BadInput(*named_by, f"expected a readable file: {path}: {error.strerror}") from None
        raise BadInput(str(path), "", f"expected a readable file: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise BadInput(str(path), "", f"expected TOML: {error}") from None
