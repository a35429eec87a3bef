"""The keyed draws of `draws` as compiled scalar functions for use in kernels; equal to the numpy form bit for bit."""

from typing import Any

import numpy as np

from swarmwire.comms.base import draws
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.base.math.compiled import log

_M0, _M1 = (np.uint64(m) for m in draws.MULTIPLIERS)
_W0, _W1 = (np.uint64(w) for w in draws.WEYL)
_LOW = np.uint64(draws.LOW32)
_S32, _S11 = np.uint64(32), np.uint64(11)
_TO_UNIT = draws.TO_UNIT
_ROUNDS = draws.ROUNDS
_CENTRE, _TAIL, _FAR_TAIL = draws.CENTRE, draws.TAIL, draws.FAR_TAIL


@njit()
def uniform(key: Any, c0: Any, c1: Any, c2: Any, c3: Any):
    """Draw a uniform number in [0, 1) by a uint64 key and the low 32 bits of four counters."""
    key = np.uint64(key)
    k0, k1 = key & _LOW, key >> _S32
    x0, x1, x2, x3 = np.uint64(c0) & _LOW, np.uint64(c1) & _LOW, np.uint64(c2) & _LOW, np.uint64(c3) & _LOW
    for _ in range(_ROUNDS):
        p0, p1 = x0 * _M0, x2 * _M1
        x0, x1, x2, x3 = (p1 >> _S32) ^ x1 ^ k0, p1 & _LOW, (p0 >> _S32) ^ x3 ^ k1, p0 & _LOW
        k0, k1 = (k0 + _W0) & _LOW, (k1 + _W1) & _LOW
    return np.float64(((x1 << _S32) | x0) >> _S11) * _TO_UNIT


@njit()
def normal(key: Any, c0: Any, c1: Any, c2: Any, c3: Any):
    """Draw a standard normal number by a uint64 key and four counters."""
    return normal_quantile(uniform(key, c0, c1, c2, c3) + 0.5 * _TO_UNIT)


@njit()
def normal_quantile(p: float):
    """Return the standard normal quantile of p in (0, 1)."""
    q = p - 0.5
    if abs(q) <= 0.425:
        return q * _ratio(_CENTRE, 0.180625 - q * q)
    root = np.sqrt(-log(max(p if q < 0.0 else 1.0 - p, 0.5 * _TO_UNIT)))
    tail = _ratio(_TAIL, root - 1.6) if root <= 5.0 else _ratio(_FAR_TAIL, root - 5.0)
    return -tail if q < 0.0 else tail


@njit()
def _ratio(pieces: tuple[tuple[float, ...], tuple[float, ...]], x: float):
    above, below = pieces[0][7], pieces[1][7]
    for i in range(6, -1, -1):
        above = above * x + pieces[0][i]
        below = below * x + pieces[1][i]
    return above / below
