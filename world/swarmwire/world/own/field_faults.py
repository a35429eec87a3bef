"""What is wrong with a field of a sense of the user's own, which no type checker looked at."""

from collections.abc import Callable, Sequence
from math import isfinite, isnan
from numbers import Real
from typing import Any, Literal, cast, get_args, get_type_hints

from swarmwire.comms.bodies.custom import MOST_WIDE
from swarmwire.world.sensors.sensor import Field, Noise

KINDS: tuple[Literal["uniform", "normal"], ...] = get_args(get_type_hints(Noise)["kind"])


def field_fault(field: Field) -> str | None:
    """What was expected of one of its values, and which there is; None if all are well. Its name may be anything."""
    of: Any = field  # what a user wrote may be of any type
    if type(of.width) is not int or not 0 <= of.width <= MOST_WIDE:
        return f"expected a width from 0 to {MOST_WIDE}; got {of.width!r}"
    if not isinstance(of.noise, Noise):
        return f"expected noise as a Noise; got {of.noise!r}"
    if of.noise.kind not in KINDS:
        return f"expected noise of the kind {' or '.join(KINDS)}; got {of.noise.kind!r}"
    for name, value in (("noise.size", of.noise.size), ("noise.relative", of.noise.relative), ("step", of.step)):
        if not _is(value, lambda number: isfinite(number) and number >= 0.0):
            return f"expected {name} as a finite number from 0; got {value!r}"
    for name, value in (("low", of.low), ("high", of.high)):
        if not _is(value, lambda number: not isnan(number)):
            return f"expected {name} as a number; got {value!r}"
    if of.low > of.high:
        return f"expected low not above high; got {of.low!r} and {of.high!r}"
    if not _is(of.blank, lambda _: True):
        return f"expected blank as a number; got {of.blank!r}"
    if of.span is not None and not _is_span(of.span):
        return f"expected span as two finite numbers that do not fall; got {of.span!r}"
    return None


def _is(value: Any, holds: Callable[[float], bool]) -> bool:
    return isinstance(value, Real) and value is not True and value is not False and holds(float(value))


def _is_span(span: object) -> bool:
    if not isinstance(span, tuple | list):
        return False
    ends = cast("Sequence[Any]", span)
    return len(ends) == 2 and all(_is(end, isfinite) for end in ends) and ends[0] <= ends[1]
