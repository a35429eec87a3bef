"""Numbers as people read them: as many decimals for all of one outcome as its greatest needs for three digits."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

_DIGITS = 3
_MOST_DECIMALS = 6
_PLAIN_UP_TO = 1e7


@dataclass(frozen=True)
class Rounding:
    """How the values of one outcome are written."""

    decimals: int | None  # None: with an exponent

    def text(self, value: float) -> str:
        """The number, with a true minus; `–` for none."""
        if not math.isfinite(value):
            return "–"
        if self.decimals is None:
            return f"{value:.{_DIGITS - 1}e}".replace("-", "−")
        rounded = f"{value:,.{self.decimals}f}".replace("-", "−")
        return rounded.lstrip("−") if not rounded.strip("−0.,") else rounded  # no minus before nothing


def rounding_of(values: Iterable[float]) -> Rounding:
    """The rounding for these values; what is not finite says nothing."""
    known = [abs(value) for value in values if math.isfinite(value)]
    greatest = max(known, default=0.0)
    if all(value == int(value) for value in known):
        return Rounding(0 if greatest < _PLAIN_UP_TO else None)
    decimals = max(0, _DIGITS - 1 - math.floor(math.log10(greatest)))
    return Rounding(decimals if decimals <= _MOST_DECIMALS and greatest < _PLAIN_UP_TO else None)
