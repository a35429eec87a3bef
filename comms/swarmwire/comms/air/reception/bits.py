"""From bits to frames: errors that strike each bit alike and on its own."""

# pyright: basic, reportUnknownMemberType=false

import math

from numba import njit


@njit(cache=True)
def all_right(error_rate, bits):
    """(1 - error_rate)^bits, without losing the digits of small rates; 1 for no bits, which may be a fraction."""
    if bits <= 0.0 or error_rate <= 0.0:
        return 1.0
    if error_rate >= 1.0:
        return 0.0
    return math.exp(bits * math.log1p(-error_rate))
