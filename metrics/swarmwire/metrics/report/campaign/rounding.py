"""Numbers as people read them: all of one response with as many decimals as their spread deserves."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

_DIGITS = 3  # of a number whose spread is not known
_DIGITS_OF_SPREAD = 2
_MAX_DIGITS = 5
_MAX_DECIMALS = 6
_PLAIN_UP_TO = 1e7


@dataclass(frozen=True)
class Rounding:
    """How the values of one response are written."""

    decimals: int | None  # None: with an exponent

    def text(self, value: float) -> str:
        """The number, with a true minus; a dash for none."""
        if not math.isfinite(value):
            return "–"
        if self.decimals is None:
            return f"{value:.{_DIGITS - 1}e}".replace("-", "−")
        rounded = f"{value:,.{self.decimals}f}".replace("-", "−")
        return rounded.lstrip("−") if not rounded.strip("−0.,") else rounded  # no minus before nothing


def rounding_of(values: Sequence[float], spreads: Sequence[float] = ()) -> Rounding:
    """The rounding for these values, whose spreads tell what is worth writing; what is not finite says nothing."""
    known = [abs(value) for value in values if math.isfinite(value) and value]
    if not known:
        return Rounding(0)
    greatest, widths = max(known), [spread for spread in spreads if math.isfinite(spread) and spread > 0.0]
    if greatest >= _PLAIN_UP_TO:
        return Rounding(None)
    if all(value.is_integer() for value in map(float, known)):
        return Rounding(0)
    wanted = _decimals(median(widths), _DIGITS_OF_SPREAD) if widths else _decimals(median(known), _DIGITS)
    decimals = max(0, min(wanted, _decimals(greatest, _MAX_DIGITS)))
    return Rounding(decimals if decimals <= _MAX_DECIMALS else None)


def _decimals(value: float, digits: int) -> int:
    """How many decimals show so many digits of it."""
    return digits - 1 - math.floor(math.log10(value))
