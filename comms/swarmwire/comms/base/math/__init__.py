"""Elementary functions with the same bits on every machine, for Python's floats and numpy's arrays.

The functions of `math` and numpy are those of the machine's C library and vector units, whose last bits differ. What a
run computes uses these: of a float they return a float, of an array of float64 an array. `compiled` has them for
compiled code, `trigonometric` and `exponential` define each once. Errors are at most 1 ulp for sin, cos, exp and log,
and 2 for the others.
"""

import math
import struct
from collections.abc import Callable
from typing import Any, NamedTuple, Protocol, overload

import numpy as np

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.math.exponential import Exponential, define_exponential
from swarmwire.comms.base.math.huge_angles import TWO_OVER_PI_DIGITS, remainder_of_huge
from swarmwire.comms.base.math.operations import Operations
from swarmwire.comms.base.math.trigonometric import Trigonometric, define_trigonometric

_DOUBLE, _LONG = struct.Struct("<d"), struct.Struct("<q")


def _bits(x: float) -> int:
    return _LONG.unpack(_DOUBLE.pack(x))[0]


def _from_bits(pattern: int) -> float:
    return _DOUBLE.unpack(_LONG.pack(pattern))[0]


def _remainder(x: float) -> tuple[float, float, int]:
    pattern = _bits(abs(x))
    r, low, quotient = remainder_of_huge(
        pattern & 0xFFFFFFFFFFFFF | 1 << 52, (pattern >> 52) - 1075, TWO_OVER_PI_DIGITS
    )
    return (-r, -low, -quotient) if x < 0.0 else (r, low, quotient)


def _reduce_huge_float(is_huge: bool, x: float, near: tuple[float, float, int]) -> tuple[float, float, int]:
    return _remainder(x) if is_huge else near


def _reduce_huge_array(is_huge: Any, x: FloatArray, near: tuple[Any, Any, Any]) -> tuple[Any, Any, Any]:
    for index in zip(*np.nonzero(is_huge), strict=True):
        near[0][index], near[1][index], near[2][index] = _remainder(float(x[index]))
    return near


class Functions(NamedTuple):
    """All functions for one kind of numbers."""

    trigonometric: Trigonometric
    exponential: Exponential

    def named(self, name: str) -> Callable[..., Any]:
        """Return one of the functions."""
        return getattr(self.trigonometric if hasattr(self.trigonometric, name) else self.exponential, name)


def _define(operations: Operations) -> Functions:
    return Functions(define_trigonometric(operations), define_exponential(operations))


def _where(condition: bool, x: Any, y: Any) -> Any:
    return x if condition else y


def _array_bits(x: FloatArray) -> IntArray:
    return x.view(np.int64)


def _array_from_bits(pattern: IntArray) -> FloatArray:
    return pattern.view(np.float64)


def _as_it_is(formula: Callable[..., Any]) -> Callable[..., Any]:
    return formula


FLOATS = _define(Operations(_where, _bits, _from_bits, math.sqrt, _reduce_huge_float, _as_it_is))
ARRAYS = _define(Operations(np.where, _array_bits, _array_from_bits, np.sqrt, _reduce_huge_array, _as_it_is))

UNARY = ("sin", "cos", "tan", "atan", "asin", "exp", "expm1", "log", "log1p", "log10", "log2", "erfc")
BINARY = ("atan2", "power", "hypot")
FEW = 16  # numbers, up to which Python's floats are faster than some dozens of calls of numpy
# Loops over arrays, the last one for the results, by function: `compiled` adds them, where there is a compiler.
COMPILED: dict[str, Callable[..., None]] = {}


class Unary(Protocol):
    """A function of a number, or of every number of an array."""

    @overload
    def __call__(self, x: float, /) -> float: ...
    @overload
    def __call__(self, x: FloatArray, /) -> FloatArray: ...


class Binary(Protocol):
    """A function of two numbers, or of every pair of numbers of two arrays, which are broadcast."""

    @overload
    def __call__(self, x: float, y: float, /) -> float: ...
    @overload
    def __call__(self, x: FloatArray, y: FloatArray | float, /) -> FloatArray: ...
    @overload
    def __call__(self, x: float, y: FloatArray, /) -> FloatArray: ...


def _function(name: str) -> Any:
    of_floats, of_arrays = FLOATS.named(name), ARRAYS.named(name)

    def function(*numbers: Any) -> Any:
        if all(isinstance(x, float | int) for x in numbers):
            return of_floats(*map(float, numbers))
        arrays = [np.asarray(x, np.float64) for x in numbers]
        shape = arrays[0].shape
        if len(arrays) > 1 and arrays[1].shape != shape:
            arrays = [np.array(x) for x in np.broadcast_arrays(*arrays)]
            shape = arrays[0].shape
        flat = [np.ascontiguousarray(x).reshape(-1) for x in arrays]
        if compiled := COMPILED.get(name):
            out = np.empty(flat[0].size)
            compiled(*flat, out)
        elif flat[0].size <= FEW:
            out = np.array([of_floats(*values) for values in zip(*(x.tolist() for x in flat), strict=True)], np.float64)
        else:
            out = of_arrays(*flat)
        return out.reshape(shape) if shape else float(out[0])

    function.__name__ = function.__qualname__ = name
    return function


sin: Unary = _function("sin")
cos: Unary = _function("cos")
tan: Unary = _function("tan")
atan: Unary = _function("atan")
asin: Unary = _function("asin")
exp: Unary = _function("exp")
expm1: Unary = _function("expm1")
log: Unary = _function("log")
log1p: Unary = _function("log1p")
log10: Unary = _function("log10")
log2: Unary = _function("log2")
erfc: Unary = _function("erfc")
atan2: Binary = _function("atan2")
power: Binary = _function("power")
hypot: Binary = _function("hypot")


def ordered_sum(values: FloatArray) -> FloatArray:
    """Return the sums along the last axis, (..., n) -> (...), added from the first number to the last.

    numpy's own sums are free to choose the order.
    """
    return np.add.accumulate(values, -1)[..., -1] if values.shape[-1] else np.zeros(values.shape[:-1])
