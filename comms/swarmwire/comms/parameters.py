"""Parameters as frozen dataclasses whose fields carry unit, bounds and a line of help in their metadata."""

from dataclasses import MISSING, Field, dataclass, field
from typing import Any


@dataclass(frozen=True, slots=True)
class Limits:
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
    limits = Limits(help, unit, at_least, at_most, above, below, choices)
    return field(default=default, metadata={"limits": limits})


def limits_of(of: "Field[Any]") -> Limits:
    """The limits of a dataclass field made by `parameter` (empty ones for any other field)."""
    found = of.metadata.get("limits")
    return found if isinstance(found, Limits) else Limits(help="")


def fault_of(value: float, limits: Limits) -> str | None:
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
