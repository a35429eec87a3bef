"""Sine and cosine of phases in turns, by one polynomial: + - * only, so that compilers take several at a time.

Sums of plane waves need many per link; with the mathematical library's they would take ten times as long.
"""

# pyright: basic, reportUnknownMemberType=false

import math

import numpy as np
from numba import njit

from swarmwire.comms.borrowing import borrowing

SUMS = 16  # that `total` adds up: it is written out for so many
# Taylor's series of sin(2 pi y) in y, up to y^21: for |y| <= 1/2 the next term is 1e-11.
_A, _B, _C, _D, _E, _F, _G, _H, _I, _J, _K = (
    (-1.0) ** n * (2.0 * math.pi) ** (2 * n + 1) / math.factorial(2 * n + 1) for n in range(11)
)


@njit(cache=True, inline="always", error_model="numpy")
def _series(y):
    z = y * y
    high = _F + z * (_G + z * (_H + z * (_I + z * (_J + z * _K))))
    return y * (_A + z * (_B + z * (_C + z * (_D + z * (_E + z * high)))))


@njit(cache=True, inline="always", error_model="numpy")
def sine(turns):
    """sin(2 pi x) of x in turns, to 2e-11 + 1e-15 |x|; odd in x to the last bit."""
    return _series(turns - np.rint(turns))


@njit(cache=True, inline="always", error_model="numpy")
def cosine(turns):
    """cos(2 pi x) of x in turns, to 2e-11 + 1e-15 |x|; even in x to the last bit."""
    return _series(0.25 - abs(turns - np.rint(turns)))


@borrowing(error_model="numpy")
def total(s):
    """The sum of SUMS numbers by halves, s[n] + s[n + 8] first: loops that end so leave sums of every 16th, n apart."""
    even = ((s[0] + s[8]) + (s[4] + s[12])) + ((s[2] + s[10]) + (s[6] + s[14]))
    odd = ((s[1] + s[9]) + (s[5] + s[13])) + ((s[3] + s[11]) + (s[7] + s[15]))
    return even + odd
