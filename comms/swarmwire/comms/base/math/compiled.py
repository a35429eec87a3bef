"""The elementary functions of `math` as compiled scalar functions for use in kernels; equal to `math` bit for bit."""

# pyright: basic

from typing import Any

import numpy as np

from swarmwire.comms.base.kernels import njit
from swarmwire.comms.base.math import BINARY, COMPILED, UNARY
from swarmwire.comms.base.math.exponential import define_exponential
from swarmwire.comms.base.math.huge_angles import TWO_OVER_PI_DIGITS, remainder_of_huge
from swarmwire.comms.base.math.operations import Operations
from swarmwire.comms.base.math.trigonometric import NEAR, define_trigonometric

# Divisions by 0 return infinity: with a check for each, loops would not be vectorised.
_formula = njit(error_model="numpy")
_DIGITS = np.array(TWO_OVER_PI_DIGITS, np.int64)
_MANTISSA, _HIDDEN = 0xFFFFFFFFFFFFF, 1 << 52
_remainder_of_huge = _formula(remainder_of_huge)


@_formula
def _where(condition: Any, x: Any, y: Any):
    return x if condition else y


@_formula
def _bits(x: Any):
    return np.float64(x).view(np.int64)


@_formula
def _from_bits(pattern: Any):
    return np.int64(pattern).view(np.float64)


@_formula
def _sqrt(x: Any):
    return np.sqrt(x)


@_formula
def _reduce_huge(is_huge: Any, x: Any, result: Any):
    if is_huge:
        pattern = np.float64(abs(x)).view(np.int64)
        r, low, quotient = _remainder_of_huge(pattern & _MANTISSA | _HIDDEN, (pattern >> 52) - 1075, _DIGITS)
        return (-r, -low, -quotient) if x < 0.0 else (r, low, quotient)
    return result


_operations = Operations(_where, _bits, _from_bits, _sqrt, _reduce_huge, _formula)
sin_cos, _near_sin, _near_cos, sin, cos, tan, atan, atan2, asin = define_trigonometric(_operations)
exp, expm1, log, log1p, log10, log2, power, hypot, erfc = define_exponential(_operations)

HALF_LOG_2_PI = 0.91893853320467274178
STIRLING = 1.0 / 12.0, -1.0 / 360.0, 1.0 / 1260.0, -1.0 / 1680.0, 1.0 / 1188.0, -691.0 / 360360.0


@_formula
def log_gamma(x: float):
    """Return the logarithm of the gamma function of a positive x, by Stirling's series from 10 on."""
    product = 1.0
    while x < 10.0:
        product *= x
        x += 1.0
    z = 1.0 / (x * x)
    series = STIRLING[5]
    for k in range(4, -1, -1):
        series = series * z + STIRLING[k]
    return (x - 0.5) * log(x) - x + HALF_LOG_2_PI + series / x - log(product)


def _loop_of(function: Any, loop: Any) -> Any:
    """Compile the loop of a function under its own name: machine code knows functions by their names."""
    loop.__qualname__ = f"loop_of_{function.__name__}"
    return _formula(loop)


def _unary_loop(function: Any) -> Any:
    def loop(x: Any, out: Any):
        for i in range(len(x)):
            out[i] = function(x[i])

    return _loop_of(function, loop)


def _angle_loop(near_function: Any, function: Any) -> Any:
    def loop(x: Any, out: Any):
        are_near = True
        for i in range(len(x)):
            out[i] = near_function(x[i])
            are_near &= abs(x[i]) <= NEAR
        if not are_near:
            for i in range(len(x)):
                out[i] = function(x[i])

    return _loop_of(near_function, loop)


@_formula
def _weighted_sum(rows: Any, weights: Any, out: Any):
    """Sum rows (k, n) times weights (k,) in eight lanes, of every eighth row each; at least eight rows."""
    lanes = np.empty((8, rows.shape[1]))
    for k in range(len(rows)):
        lane, row, weight = lanes[k % 8], rows[k], weights[k]
        if k < 8:
            for i in range(len(row)):
                lane[i] = row[i] * weight
        else:
            for i in range(len(row)):
                lane[i] = lane[i] + row[i] * weight
    a, b, c, d, e, f, g, h = lanes[0], lanes[1], lanes[2], lanes[3], lanes[4], lanes[5], lanes[6], lanes[7]
    for i in range(len(out)):
        out[i] = 0.0 + (((a[i] + b[i]) + (c[i] + d[i])) + ((e[i] + f[i]) + (g[i] + h[i])))


def _binary_loop(function: Any) -> Any:
    def loop(x: Any, y: Any, out: Any):
        for i in range(len(x)):
            out[i] = function(x[i], y[i])

    return _loop_of(function, loop)


COMPILED.update({name: _unary_loop(globals()[name]) for name in UNARY})
COMPILED.update({name: _binary_loop(globals()[name]) for name in BINARY})
# By itself LLVM does not inline so long a function, and an array then takes ten times as long.
COMPILED["atan2"] = _binary_loop(njit(error_model="numpy", forceinline=True)(getattr(atan2, "py_func", atan2)))
COMPILED["weighted_sum"] = _weighted_sum
COMPILED["sin"], COMPILED["cos"] = _angle_loop(_near_sin, sin), _angle_loop(_near_cos, cos)
