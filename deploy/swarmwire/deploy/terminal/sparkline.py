"""A small curve in one line of text."""

import math
from collections.abc import Sequence

BARS = "▁▂▃▄▅▆▇"  # not the full block: curves in lines below one another would touch
NOTHING = " "


def sparkline(values: Sequence[float], least: float, largest: float) -> str:
    """A character per value, from the least to the largest; a gap for NaN.

    >>> sparkline([0.0, 0.5, 1.0, math.nan], 0.0, 1.0)
    '▁▄▇ '
    """
    span = largest - least
    return "".join(
        NOTHING if math.isnan(value) else BARS[_level((value - least) / span if span > 0 else 0.0)] for value in values
    )


def _level(share: float) -> int:
    return min(max(math.floor(share * len(BARS)), 0), len(BARS) - 1)
