"""Configuration basics: dataclass parameters with bounds, explained enums, and readers of JSON and TOML.

A parameter is a field of a frozen dataclass whose metadata carry its unit, its bounds and a line of help. The readers
turn every fault of a text into `ValueError` or `BadInput`, also the faults that Python's own readers raise as other
errors. `did_you_mean` lists the valid keys in an error about an unknown key.
"""

import json
import re
import tomllib
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import MISSING, Field, dataclass, field
from difflib import get_close_matches
from enum import IntEnum
from math import isfinite
from pathlib import Path
from typing import Any, Self, TypeVar, cast

import msgspec

from swarmwire.comms.base.errors import BadInput

T = TypeVar("T")

FORMAT_KEY = "format"  # key of the version of a file's format
MIN_INTEGER, MAX_INTEGER = -(2**63), 2**64 - 1  # limits of msgpack
MISSING_FIELD = re.compile(r"Object missing required field `(\w+)`")  # error text of msgspec
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
    """Return a dataclass field with `Bounds` in its metadata; without a default the parameter is required."""
    bounds = Bounds(help, unit, at_least, at_most, above, below, choices)
    return field(default=default, metadata={"bounds": bounds})


def bounds_of(parameter_field: "Field[Any]") -> Bounds:
    """Return the bounds of a dataclass field made by `parameter`; empty bounds for any other field."""
    bounds = parameter_field.metadata.get("bounds")
    return bounds if isinstance(bounds, Bounds) else Bounds(help="")


def fault_of(value: float, bounds: Bounds) -> str | None:
    """Return the expectation that `value` does not meet, as a text; None if it is within its bounds.

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
    """Integers with a meaning each: `NAME = 0, "the meaning"`."""

    meaning: str

    def __new__(cls, value: int, meaning: str) -> Self:
        """Return the member with this number."""
        member = int.__new__(cls, value)
        member._value_ = value
        member.meaning = meaning
        return member


def did_you_mean(valid: Iterable[str], name: object = None) -> str:
    """Return the text "one of a, b, c" for an error about an unknown `name`; a similar valid name comes first.

    >>> did_you_mean(["loss", "range_m", "model"], "range")
    'one of range_m (did you mean this?), loss, model'
    """
    names = list(valid)
    if not names:
        return "none"
    close = get_close_matches(name, names, n=1) if isinstance(name, str) else []
    first = [f"{match} (did you mean this?)" for match in close]
    return f"one of {', '.join([*first, *(other for other in names if other not in close)])}"


def from_json(text: str | bytes) -> Any:
    """Parse a JSON text; ValueError if it is not JSON, also where Python's reader raises another error."""
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError(TOO_DEEP) from None


def from_toml(text: str) -> dict[str, Any]:
    """Parse a TOML text; `tomllib.TOMLDecodeError` if it is not TOML, also where Python raises another error."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        raise
    except RecursionError:
        raise tomllib.TOMLDecodeError(TOO_DEEP) from None
    except ValueError as error:  # a number of thousands of digits, a date that does not exist
        raise tomllib.TOMLDecodeError(str(error)) from None


def folder_of(path: Path | str) -> Path:
    """Return the folder of a configuration file, for the relative paths in it; for a link, the folder of its target."""
    path = Path(path)
    return (path.resolve() if path.is_symlink() else path).parent


def scenario_path(path: Path | str) -> Path:
    """Return the path of a scenario's file: `scenario.toml` of a folder that has one, else the path itself."""
    file = Path(path, "scenario.toml")
    with suppress(OSError):  # rights are missing, or the name is too long: the error comes where it is read
        if file.is_file():
            return file
    return Path(path)


def read_toml(path: Path, named_by: tuple[str, str] | None = None) -> dict[str, Any]:
    """Read a TOML file; BadInput if it cannot be read.

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


def converted(kind: type[T], value: object, where: str, strict: bool = True) -> T:
    """Convert a value of maps, lists and plain values to an instance of a typed class, with msgspec.

    BadInput names the file and the key that does not fit. Unknown keys are ignored, unless the class refuses them.
    Unless `strict`, texts such as "0.05" are read as numbers where the class has these.
    """
    try:
        return msgspec.convert(value, kind, strict=strict)
    except msgspec.ValidationError as error:
        fault, _, path = str(error).partition(" - at `$")
        missing = MISSING_FIELD.fullmatch(fault)
        key = path.rstrip("`") + (f".{missing[1]}" if missing else "")
        expected = "is missing: expected a value" if missing else f"{fault[0].lower()}{fault[1:]}"
        raise BadInput(where, key.strip("."), expected) from None


def read_json(kind: type[T], path: Path, version: int) -> T:
    """Read a JSON file as an instance of a typed class; BadInput unless its `format` is `version`."""
    try:
        content = from_json(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise BadInput(str(path.parent), path.name, f"expected a readable file: {error.strerror}") from None
    except ValueError as error:  # no JSON, or no UTF-8
        raise BadInput(str(path), "", f"expected JSON: {error}") from None
    check_format(content, version, str(path))
    return converted(kind, content, str(path))


def check_plain(value: object, where: str, key: str) -> None:
    """Raise BadInput unless JSON and msgpack can represent the value, as run folders and frames need.

    Plain values are finite floats, integers of 64 bits, strings, booleans, and lists and tables of these. The
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


def check_format(content: object, version: int, where: str) -> None:
    """Raise BadInput unless the `format` of a file's table is `version`.

    Call it before the other keys are read, since other formats may have other keys. Content that is no table passes:
    the reader of the keys refuses it.

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
        raise BadInput(where, FORMAT_KEY, f"is missing: expected {version}")
    actual = table[FORMAT_KEY]
    if type(actual) is int and actual == version:
        return
    if type(actual) is int and actual > version:
        hint = ": made by a newer swarmwire; upgrade to read it"
    elif type(actual) is int and actual > 0:
        hint = ": made by an older swarmwire; that one reads it"
    else:
        hint = ""
    raise BadInput(where, FORMAT_KEY, f"expected {version}, got {actual!r}{hint}")
