"""What the formulas know of the numbers that they are for: floats, arrays or compiled floats."""

from collections.abc import Callable
from typing import Any, NamedTuple

Number = Any  # a float, an array of float64, or a compiled float64
Integer = Any  # int64 of the same kind

INF, NAN = float("inf"), float("nan")
ROUND = 6755399441055744.0  # 1.5 * 2^52: x + ROUND - ROUND rounds |x| < 2^51 to a whole number
ROUND_BITS = 0x4338000000000000  # of ROUND; the bits of x + ROUND are greater by the whole number
HIGH_WORD = -(2**32)  # mask of the sign, the exponent and the first 20 bits of the mantissa


class Operations(NamedTuple):
    """Operations on one kind of numbers that have no operator in Python."""

    where: Callable[[Any, Any, Any], Any]  # (condition, value if true, value if false)
    bits: Callable[[Number], Integer]  # the 64 bits of a float as a signed integer
    from_bits: Callable[[Integer], Number]
    sqrt: Callable[[Number], Number]
    # (condition, x, result) -> (remainder of x by pi / 2, its rounding error, quotient modulo 4), of x where it is huge
    reduce_huge: Callable[[Any, Number, tuple[Number, Number, Integer]], tuple[Number, Number, Integer]]
    compile: Callable[[Any], Any]  # decorates each formula
