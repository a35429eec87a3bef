"""Reduction of huge arguments by pi / 2, after Payne and Hanek, with whole numbers of 64 bits alone.

An argument is m 2^e with m of 53 bits. Its product with 2 / pi is needed modulo 4, so that of the digits of 2 / pi only
a window counts. Digits have 24 bits, and sums of their products stay below 2^63.
"""

from typing import Any

DIGIT_BITS, DIGIT = 24, 2**24 - 1
LEADING = 3  # zero digits before the first of 2 / pi
WINDOW = 10  # digits of the fraction: an argument is at least 2^-61 away from a multiple of pi / 2
_HEX = (
    "a2f9836e4e441529fc2757d1f534ddc0db6295993c439041fe5163abdebbc561b7246e3a424dd2e00649"
    "2eea09d1921cfe1deb1cb129a73ee88235f52ebb4484e99c7026b45f7e413991d639835339f49c845f8b"
    "bdf9283b1ff897ffde05980fef2f118b5a0a6d1f6d367ecf27cb09b74f463f669e5fea2d7527bac7ebe5"
    "f17b3d0739f78a5292ea6bfb5fb11f8d5d0856033046fc7b6babf0cfbc209af4361da9e391615ee61b08"
)
TWO_OVER_PI_DIGITS = (0,) * LEADING + tuple(int(_HEX[i : i + 6], 16) for i in range(0, len(_HEX), 6))
HALF_PI, HALF_PI_LOW = 1.57079632679489655800e00, 6.12323399573676603587e-17
SPLIT = 2.0**27 + 1.0


def remainder_of_huge(mantissa: Any, exponent: Any, digits: Any) -> Any:
    """Return the remainder by pi / 2 of mantissa 2^exponent, its rounding error, and the quotient modulo 4.

    Both are whole numbers, the mantissa of 53 bits and the exponent from -32. `digits` are TWO_OVER_PI_DIGITS.
    """
    first = (exponent - 2) // DIGIT_BITS  # digits before it only add multiples of 4
    shift = exponent - DIGIT_BITS * first  # 2 to 25
    m0 = (mantissa & DIGIT) << shift
    m1 = ((mantissa >> DIGIT_BITS & DIGIT) << shift) + (m0 >> DIGIT_BITS)
    m2 = ((mantissa >> 2 * DIGIT_BITS) << shift) + (m1 >> DIGIT_BITS)
    m3 = m2 >> DIGIT_BITS
    m0, m1, m2 = m0 & DIGIT, m1 & DIGIT, m2 & DIGIT
    start = first + LEADING
    carry = 0
    # The digits of the fraction from the last to the first; d0 is the newest.
    d0 = d1 = d2 = d3 = d4 = d5 = d6 = d7 = d8 = 0
    for n in range(WINDOW - 1, -1, -1):
        i = start + n
        carry += m0 * digits[i] + m1 * digits[i + 1] + m2 * digits[i + 2] + m3 * digits[i + 3]
        d8, d7, d6, d5, d4, d3, d2, d1 = d7, d6, d5, d4, d3, d2, d1, d0
        d0 = carry & DIGIT
        carry >>= DIGIT_BITS
    quotient = carry + m1 * digits[start] + m2 * digits[start + 1] + m3 * digits[start + 2]
    if start > 0:
        quotient += m0 * digits[start - 1]
    is_negative = d0 >> (DIGIT_BITS - 1) == 1  # a fraction of 1/2 or more: the next quotient is nearer
    flip = DIGIT if is_negative else 0
    d0, d1, d2, d3, d4 = d0 ^ flip, d1 ^ flip, d2 ^ flip, d3 ^ flip, d4 ^ flip
    d5, d6, d7, d8 = d5 ^ flip, d6 ^ flip, d7 ^ flip, d8 ^ flip
    unit = 1.0
    for _ in range(4):  # leading zeros, so that the first two digits have 25 bits at least
        if d0 == 0:
            d0, d1, d2, d3, d4, d5, d6, d7, d8 = d1, d2, d3, d4, d5, d6, d7, d8, 0
            unit = unit * 2.0**-24
    high = (d0 << DIGIT_BITS | d1) * (unit * 2.0**-48)
    low = (d2 << DIGIT_BITS | d3) * (unit * 2.0**-96) + (d4 << DIGIT_BITS | d5) * (unit * 2.0**-144)
    # (high + low) pi / 2; the product of the first parts is split, so that its rounding error is known
    a = high * SPLIT
    a_high = a - (a - high)
    a_low = high - a_high
    b = HALF_PI * SPLIT
    b_high = b - (b - HALF_PI)
    b_low = HALF_PI - b_high
    product = high * HALF_PI
    error = ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low
    low_part = error + (high * HALF_PI_LOW + low * HALF_PI)
    r = product + low_part
    tail = low_part - (r - product)
    if is_negative:
        return -r, -tail, (quotient + 1) & 3
    return r, tail, quotient & 3
