"""Values of parameters: whether two are the same, and how they are written."""

import json
import math
import tomllib
from collections.abc import Iterable

from swarmwire.comms.config import from_toml
from swarmwire.metrics.campaign.about import Point, Value

ROUNDING = 1e-9  # relative: 0.1 + 0.2 is 0.3


def same_value(one: Value, other: Value) -> bool:
    """Whether they are equal, numbers but for rounding."""
    numbers = (int, float)
    if isinstance(one, bool) or isinstance(other, bool):
        return one is other
    if isinstance(one, numbers) and isinstance(other, numbers):
        return math.isclose(one, other, rel_tol=ROUNDING)
    return one == other


def value_from(text: str) -> Value:
    """What a person writes: a TOML value, else a text.

    >>> value_from("0.4"), value_from("true"), value_from("discs")
    (0.4, True, 'discs')
    """
    try:
        found = from_toml(f"value = {text}")
    except tomllib.TOMLDecodeError:
        return text.strip()
    return found["value"] if len(found) == 1 else text


def value_text(value: Value, digits: int = 9) -> str:
    """A value as a person reads it: so many digits of a number that need not be whole.

    >>> value_text(0.30000000000000004), value_text("discs"), value_text([1, 2])
    ('0.3', 'discs', '[1, 2]')
    """
    if isinstance(value, float):
        return f"{value:.{digits}g}"
    return value if isinstance(value, str) else json.dumps(value)


def point_text(point: Point, paths: Iterable[str] | None = None) -> str:
    """The values of a point, or of these paths in it.

    >>> point_text({"radio.loss": 0.2, "physics.engine": "discs"})
    'radio.loss=0.2, physics.engine=discs'
    """
    chosen = list(point) if paths is None else [path for path in paths if path in point]
    return ", ".join(f"{path}={value_text(point[path])}" for path in chosen)
