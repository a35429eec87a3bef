"""Statistics as people read them: three digits, and `> 100` for what lies beyond the limit."""

import math

from swarmwire.metrics.statistics.interval import Interval
from swarmwire.metrics.statistics.summary import Summary

UNKNOWN_TEXT = "–"  # in place of a number


def number_text(value: float, sign: bool = False) -> str:
    """A number with three digits, or all before its point.

    >>> number_text(0.12345), number_text(12345.6), number_text(0.5, sign=True), number_text(-0.0)
    ('0.123', '12346', '+0.5', '0')
    """
    if math.isnan(value):
        return UNKNOWN_TEXT
    if value == 0.0:
        return "0"
    signed = "+" if sign else ""
    return f"{value:{signed}.0f}" if 1000.0 <= abs(value) < 1e9 else f"{value:{signed}.3g}"


def quantile_text(value: float, limit: float) -> str:
    """A quantile of times; NaN lies beyond the limit.

    >>> quantile_text(42.0, 100.0), quantile_text(float("nan"), 100.0)
    ('42', '> 100')
    """
    return f"> {number_text(limit)}" if math.isnan(value) and not math.isnan(limit) else number_text(value)


def quartiles_text(of: Summary) -> str:
    """The median, and the quartiles around it.

    `12 (8 to > 100)`, or a dash of no values.
    """
    q25, q50, q75 = (quantile_text(value, of.limit) for value in (of.q25, of.q50, of.q75))
    return f"{q50} ({q25} to {q75})" if of.n else UNKNOWN_TEXT


def interval_text(interval: Interval, sign: bool = False) -> str:
    """An interval, which may be open.

    >>> interval_text(Interval(1.0, 2.0)), interval_text(Interval(3.0, float("inf")))
    ('1 to 2', '3 or more')
    >>> interval_text(Interval(-float("inf"), 2.0), sign=True)
    '+2 or less'
    """
    low, high = interval
    if math.isnan(low) or math.isnan(high) or (math.isinf(low) and math.isinf(high)):
        return UNKNOWN_TEXT
    if math.isinf(high):
        return f"{number_text(low, sign)} or more"
    if math.isinf(low):
        return f"{number_text(high, sign)} or less"
    return f"{number_text(low, sign)} to {number_text(high, sign)}"
