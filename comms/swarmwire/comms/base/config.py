"""Configuration basics: dataclass parameters with bounds, explained enums, and readers of JSON and TOML.

A parameter is a field of a frozen dataclass whose metadata carry its unit, its bounds and a line of help. The readers
turn every fault of a text into `ValueError` or `BadInput`, also the faults that Python's own readers raise as other
errors. `did_you_mean` names the known keys in an error about an unknown one.
"""

import json
import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, Field, dataclass, field
from difflib import get_close_matches
from enum import IntEnum
from math import isfinite
from pathlib import Path
from typing import Any, Self, TypeVar, cast

import msgspec

from swarmwire.comms.base.errors import BadInput

T = TypeVar("T")

FORMAT_KEY = "format"  # in a file: the version of its format
MIN_INTEGER, MAX_INTEGER = -(2**63), 2**64 - 1  # in msgpack
MISSING_FIELD = re.compile(r"Object missing required field `(\w+)`")  # as msgspec says it
TOO_DEEP = "lists or tables within one another, too many to be meant"


@dataclass(frozen=True, slots=True)
class Bounds:
    """Help text, unit and allowed values of a parameter; `at_least` and `at_most` include the bound."""

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
    """A dataclass field with `Bounds` in its metadata; without a default the parameter is required."""
    bounds = Bounds(help, unit, at_least, at_most, above, below, choices)
    return field(default=default, metadata={"bounds": bounds})


def bounds_of(parameter_field: "Field[Any]") -> Bounds:
    """The bounds of a dataclass field made by `parameter` (empty ones for any other field)."""
    bounds = parameter_field.metadata.get("bounds")
    return bounds if isinstance(bounds, Bounds) else Bounds(help="")


def fault_of(value: float, bounds: Bounds) -> str | None:
    """The expectation that `value` does not meet, as a text; None if it is within its bounds.

    >>> fault_of(-1.0, Bounds("how long it lasts", unit="s", above=0.0))
    'expected more than 0 s, got -1.0'
    """
    unit = f" {bounds.unit}" if bounds.unit else ""
    if bounds.at_least is not None and not value >= bounds.at_least:
        return f"expected at least {bounds.at_least:g}{unit}, got {value!r}"
    if bounds.at_most is not None and not value <= bounds.at_most:
        return f"expected at most {bounds.at_most:g}{unit}, got {value!r}"
    if bounds.above is not None and not value > bounds.above:
        return f"expected more than {bounds.above:g}{unit}, got {value!r}"
    if bounds.below is not None and not value < bounds.below:
        return f"expected less than {bounds.below:g}{unit}, got {value!r}"
    return None


@dataclass(frozen=True)
class NoParameters:
    """An empty set of parameters."""


class ExplainedEnum(IntEnum):
    """Integers, each with its meaning: `NAME = 0, "its meaning"`."""

    meaning: str

    def __new__(cls, value: int, meaning: str) -> Self:
        """The member of this number."""
        member = int.__new__(cls, value)
        member._value_ = value
        member.meaning = meaning
        return member


def did_you_mean(known: Iterable[str], name: object = None) -> str:
    """The text "one of a, b, c" for an error about an unknown `name`; a known name close to it stands first.

    >>> did_you_mean(["loss", "range_m", "model"], "range")
    'one of range_m (did you mean this?), loss, model'
    """
    names = list(known)
    if not names:
        return "none"
    close = get_close_matches(name, names, n=1) if isinstance(name, str) else []
    first = [f"{match} (did you mean this?)" for match in close]
    return f"one of {', '.join([*first, *(known for known in names if known not in close)])}"


def from_json(text: str | bytes) -> Any:
    """The value of a JSON text; ValueError if it is no JSON, also where Python's reader raises another error."""
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError(TOO_DEEP) from None


def from_toml(text: str) -> dict[str, Any]:
    """The table of a TOML text; `tomllib.TOMLDecodeError` if it is no TOML, also where Python raises another error."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        raise
    except RecursionError:
        raise tomllib.TOMLDecodeError(TOO_DEEP) from None
    except ValueError as error:  # a number of thousands of digits, a date that does not exist
        raise tomllib.TOMLDecodeError(str(error)) from None


def folder_of(path: Path | str) -> Path:
    """Folder in which the files that a configuration file names are looked up; of a link, the folder of its target."""
    path = Path(path)
    return (path.resolve() if path.is_symlink() else path).parent


def scenario_path(path: Path | str) -> Path:
    """Path of a scenario's file: of a folder that has one, that of its `scenario.toml`."""
    file = Path(path, "scenario.toml")
    return file if file.is_file() else Path(path)


def read_toml(path: Path, named_by: tuple[str, str] | None = None) -> dict[str, Any]:
    """The content of a TOML file; BadInput if it cannot be read.

    `named_by` is the (file, key) that refers to this file: the error about a missing file names them.
    """
    try:
        return from_toml(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        if named_by is not None:
            raise BadInput(*named_by, f"expected a readable file: {path}: {error.strerror}") from None
        raise BadInput(str(path), "", f"expected a readable file: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise BadInput(str(path), "", f"expected TOML: {error}") from None


def converted(kind: type[T], value: object, where: str) -> T:
    """A value of a file, made of maps, lists and plain values, as an instance of a typed class (msgspec converts it).

    BadInput names the file and the key that does not fit. Unknown keys are ignored, unless the class refuses them.
    """
    try:
        return msgspec.convert(value, kind)
    except msgspec.ValidationError as error:
        fault, _, path = str(error).partition(" - at `$")
        missing = MISSING_FIELD.fullmatch(fault)
        key = path.rstrip("`") + (f".{missing[1]}" if missing else "")
        expected = "is missing: expected a value" if missing else f"{fault[0].lower()}{fault[1:]}"
        raise BadInput(where, key.strip("."), expected) from None


def read_json(kind: type[T], path: Path, known: int) -> T:
    """The JSON object of a file as an instance of a typed class; BadInput unless it is one, of the known format."""
    try:
        found = from_json(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise BadInput(str(path.parent), path.name, f"expected a readable file: {error.strerror}") from None
    except ValueError as error:  # no JSON, or no UTF-8
        raise BadInput(str(path), "", f"expected JSON: {error}") from None
    check_format(found, known, str(path))
    return converted(kind, found, str(path))


def check_plain(value: object, where: str, key: str) -> None:
    """Raise BadInput unless JSON and msgpack, and so run folders and frames, can hold the value.

    Plain values are finite numbers, whole numbers of 64 bits, texts, truth values, and lists and tables of these. The
    error has `where` and the path of the value within `key`.
    """
    if isinstance(value, Mapping):
        for name, item in cast("Mapping[object, object]", value).items():
            inner = f"{key}.{name}"
            if not isinstance(name, str):
                raise BadInput(where, inner, f"expected a text as the name of a key, got {name!r}")
            check_plain(item, where, inner)
    elif isinstance(value, list | tuple):
        for i, item in enumerate(cast("list[object]", value)):
            check_plain(item, where, f"{key}[{i}]")
    elif isinstance(value, float) and not isfinite(value):
        raise BadInput(where, key, f"expected a finite number, got {value!r}")
    elif isinstance(value, int) and not MIN_INTEGER <= value <= MAX_INTEGER:
        raise BadInput(where, key, f"expected a whole number of 64 bits, got one of {value.bit_length()}")
    elif not isinstance(value, bool | int | float | str):
        raise BadInput(where, key, f"expected a number, text, true, false, list or table, got {value!r}")


def check_format(content: object, known: int, where: str) -> None:
    """Raise BadInput unless the table of a file has the known version as its `format`.

    Call it before the rest of the file is read, since other formats may have other keys. Content that is no table
    passes: the reader of the rest refuses it.

    >>> check_format({"format": 1}, 1, "a.toml")
    >>> check_format({"format": 2}, 1, "a")
    Traceback (most recent call last):
    swarmwire.comms.base.errors.BadInput: a: format: expected 1, got 2: made by a newer swarmwire; upgrade to read it
    >>> check_format({}, 1, "a.toml")
    Traceback (most recent call last):
    swarmwire.comms.base.errors.BadInput: a.toml: format: is missing: expected 1
    """
    if not isinstance(content, Mapping):
        return
    table = cast("Mapping[str, object]", content)
    if FORMAT_KEY not in table:
        raise BadInput(where, FORMAT_KEY, f"is missing: expected {known}")
    version = table[FORMAT_KEY]
    if type(version) is int and version == known:
        return
    if type(version) is int and version > known:
        hint = ": made by a newer swarmwire; upgrade to read it"
    elif type(version) is int and version > 0:
        hint = ": made by an older swarmwire; that one reads it"
    else:
        hint = ""
    raise BadInput(where, FORMAT_KEY, f"expected {known}, got {version!r}{hint}")
