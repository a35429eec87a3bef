"""Estimates: a fitted value and how sure it is."""

from typing import NamedTuple


class Estimate(NamedTuple):
    """A value and its standard error, in the unit that its name tells."""

    value: float
    standard_error: float  # NaN: the data do not tell
