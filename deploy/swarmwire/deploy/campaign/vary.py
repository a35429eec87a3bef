"""What a campaign varies: a path of the scenario, and the values that it takes, listed or as a range."""

import tomllib
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from math import isinf
from typing import Any, cast

from swarmwire.comms.config import from_toml
from swarmwire.comms.errors import BadInput

EXPECTED = (
    "expected PATH=FIRST:LAST:COUNT, such as radio.loss=0:0.8:9, or PATH=5,10,20; "
    "for random and latin designs PATH=FIRST:LAST; a range may end in :log"
)
LOG = "log"
MAX_VALUES = 100_000
RANGE_KEYS = ("from", "to", "count", "scale")


@dataclass(frozen=True)
class Range:
    """Numbers from one to another, evenly or in equal ratios."""

    first: Fraction
    last: Fraction
    count: int | None  # None: a design draws them
    log: bool = False

    def at(self, share: Fraction) -> float:
        """The number at a share of the way, from 0 to 1."""
        if not self.log or share in (0, 1):
            return float(self.first + (self.last - self.first) * share)
        first, last, part = float(self.first), float(self.last), float(share)
        return float(f"{first ** (1.0 - part) * last**part:.12g}")  # 10.0, not 9.999999999999998

    def values(self) -> list[float]:
        """All of them, with a count; the first and the last among them."""
        count = self.count or 1
        return [self.at(Fraction(place, max(count - 1, 1))) for place in range(count)]


@dataclass(frozen=True)
class Vary:
    """One path of the scenario that is varied."""

    path: str
    values: tuple[Any, ...] | Range
    said: str  # by whoever asked for it, for messages

    def refused(self, expected: str) -> BadInput:
        """The error that says what was expected of it."""
        return BadInput(self.said, "", expected)


def vary_of(text: str) -> Vary:
    """What `--vary PATH=…` says; BadInput if it is none of the forms."""
    said = f"--vary {text}"
    path, equals, values = text.partition("=")
    path = ".".join(key.strip() for key in path.split("."))
    if not equals or not all(path.split(".")) or not values.strip():
        raise BadInput(said, "", EXPECTED)
    return _checked(Vary(path, _range_of(values, said) or tuple(_list_of(values)), said))


def vary_from(path: str, given: object, said: str) -> Vary:
    """What a campaign's file or a mapping says: a list, a table with from, to, count and scale, or a text as above."""
    if isinstance(given, str):
        return vary_of(f"{path}={given}")
    if isinstance(given, Mapping):
        return _checked(Vary(path, _range_from(cast("Mapping[str, Any]", given), said), said))
    if isinstance(given, list | tuple):
        return _checked(Vary(path, tuple(cast("list[Any]", given)), said))
    raise BadInput(said, "", f"expected a list of values, or {{ from = 0.0, to = 0.8, count = 9 }}; got {given!r}")


def _range_of(text: str, said: str) -> Range | None:
    """The range that a text describes; None if it is a list of values."""
    parts = [part.strip() for part in text.split(":")]
    first = _number(parts[0])
    if len(parts) == 1 or first is None:
        return None
    log = parts[-1] == LOG
    parts = parts[: len(parts) - log]
    last = _number(parts[1]) if len(parts) in (2, 3) else None
    if last is None or (len(parts) == 3 and not parts[2].isdecimal()):
        raise BadInput(said, "", EXPECTED)
    return Range(first, last, int(parts[2]) if len(parts) == 3 else None, log)


def _range_from(table: Mapping[str, Any], said: str) -> Range:
    ends = [_number(str(table.get(key))) for key in ("from", "to")]
    count, scale = table.get("count"), table.get("scale", "linear")
    known = set(table) <= set(RANGE_KEYS) and scale in ("linear", LOG)
    if not known or None in ends or not (count is None or type(count) is int):
        expected = 'expected { from = 0.0, to = 0.8, count = 9 }, with scale = "log" for equal ratios'
        raise BadInput(said, "", f"{expected}; got {dict(table)}")
    first, last = (cast("Fraction", end) for end in ends)
    return Range(first, last, count, scale == LOG)


def _list_of(text: str) -> list[Any]:
    """TOML values between commas; what is none is a text."""
    with suppress(tomllib.TOMLDecodeError):  # not all of them are TOML
        found = from_toml(f"value = [{text}]")
        if len(found) == 1:
            return cast("list[Any]", found["value"])
    return [_value(part.strip()) for part in text.split(",") if part.strip()]


def _value(text: str) -> Any:
    try:
        found = from_toml(f"value = {text}")
    except tomllib.TOMLDecodeError:
        return text
    return found["value"] if len(found) == 1 else text


def _number(text: str) -> Fraction | None:
    """As it stands there, so that a step of 0.1 is a tenth; None for what no float can be, such as 1e400."""
    try:
        near = float(text)  # first: as a fraction 1e999999999 would fill the memory
        return None if isinf(near) else Fraction(text) if near else Fraction(0)
    except (ValueError, OverflowError):
        return None


def _checked(vary: Vary) -> Vary:
    if isinstance(vary.values, Range):
        _check_range(vary, vary.values)
    elif not 0 < len(vary.values) <= MAX_VALUES:
        raise vary.refused(f"expected 1 to {MAX_VALUES} values, got {len(vary.values)}")
    elif any(value in vary.values[:place] for place, value in enumerate(vary.values)):
        raise vary.refused("expected different values: one is there twice")
    return vary


def _check_range(vary: Vary, of: Range) -> None:
    if of.count is not None and not 0 < of.count <= MAX_VALUES:
        raise vary.refused(f"expected a COUNT from 1 to {MAX_VALUES}, got {of.count}")
    if of.first == of.last and of.count != 1:
        raise vary.refused("expected FIRST and LAST to differ")
    if of.log and not (of.first > 0 and of.last > 0):
        raise vary.refused("expected FIRST and LAST above 0 for equal ratios (log)")
