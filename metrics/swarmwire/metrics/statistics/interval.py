"""An interval of confidence."""

from typing import NamedTuple

LEVEL = 0.95  # how sure, unless told


class Interval(NamedTuple):
    """From low to high. NaN: the data do not tell; infinite: open on that side, as where times are censored."""

    low: float
    high: float


UNKNOWN = Interval(float("nan"), float("nan"))  # of too few runs
