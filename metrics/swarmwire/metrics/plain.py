"""Numbers as JSON has them."""

import math


def plain(number: float) -> float | None:
    """A Python float, or None for what is not a number: undefined, or nothing to measure."""
    value = float(number)
    return None if math.isnan(value) else value
