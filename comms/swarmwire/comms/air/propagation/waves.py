"""Sine and cosine of phases in turns, by one polynomial: + - * only, so that compilers take several at a time.

Sums of plane waves need many per link; with the mathematical library's they would take ten times as long.
"""

# pyright: basic, reportUnknownMemberType=false

import math

import numpy as np
from numba import njit

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


@njit(cache=True, error_model="numpy")
def total(parts):
    """The sum of an array whose length is a power of two, by halves, in an order of its own; the array is used up."""
    width = len(parts) // 2
    while width >= 1:
        for n in range(width):
            parts[n] += parts[n + width]
        width //= 2
    return parts[0]
