"""Formulas of sine, cosine, tangent and their inverses, each written once for all kinds of numbers.

Formulas and coefficients are those of fdlibm 5.3 (Sun Microsystems, 1993 to 2004), with errors below 1 ulp.
Both sides of every choice are computed, so that compiled loops and arrays need no branches; arguments that a side
cannot have are replaced before.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from swarmwire.comms.base.math.operations import HIGH_WORD, INF, NAN, ROUND, Integer, Number, Operations

TWO_66 = 2.0**66
# pi / 2 in three parts, the first two with 33 bits, so that their products with q < 2^20 are exact.
NEAR = 1.0e6  # arguments of sine and cosine up to which q is so small
TWO_OVER_PI = 6.36619772367581382433e-01
HALF_PI_1, HALF_PI_2, HALF_PI_3 = 1.57079632673412561417e00, 6.07710050630396597660e-11, 2.02226624879595063154e-21
HALF_PI, HALF_PI_LOW = 1.57079632679489655800e00, 6.12323399573676603587e-17
QUARTER_PI = 7.85398163397448278999e-01
PI, PI_LOW = 3.14159265358979311600e00, 1.22464679914735317720e-16

SIN = (
    *(-1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04),
    *(2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10),
)
COS = (
    *(4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05),
    *(-2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11),
)
ATAN = (
    *(3.33333333333329318027e-01, -1.99999999998764832476e-01, 1.42857142725034663711e-01),
    *(-1.11111104054623557880e-01, 9.09088713343650656196e-02, -7.69187620504482999495e-02),
    *(6.66107313738753120669e-02, -5.83357013379057348645e-02, 4.97687799461593236017e-02),
    *(-3.65315727442169155270e-02, 1.62858201153657823623e-02),
)
ATAN_HALF, ATAN_HALF_LOW = 4.63647609000806093515e-01, 2.26987774529616870924e-17
ATAN_ONE_LOW = 3.06161699786838301793e-17
ATAN_THREE_HALVES, ATAN_THREE_HALVES_LOW = 9.82793723247329054082e-01, 1.39033110312309984516e-17
ASIN_P = (
    *(1.66666666666666657415e-01, -3.25565818622400915405e-01, 2.01212532134862925881e-01),
    *(-4.00555345006794114027e-02, 7.91534994289814532176e-04, 3.47933107596021167570e-05),
)
ASIN_Q = (
    -2.40339491173441421878e00,
    2.02094576023350569471e00,
    -6.88283971605453293030e-01,
    7.70381505559019352791e-02,
)


class Trigonometric(NamedTuple):
    """The functions for one kind of numbers. `near_` functions are for arguments up to NEAR alone."""

    sin_cos: Callable[[Number], tuple[Number, Number]]
    near_sin: Callable[[Number], Number]
    near_cos: Callable[[Number], Number]
    sin: Callable[[Number], Number]
    cos: Callable[[Number], Number]
    tan: Callable[[Number], Number]
    atan: Callable[[Number], Number]
    atan2: Callable[[Number, Number], Number]
    asin: Callable[[Number], Number]


def define_trigonometric(operations: Operations) -> Trigonometric:  # noqa: PLR0915 - many short functions
    """Return the functions for numbers of one kind."""
    where, bits, from_bits, sqrt, reduce_huge, formula = operations

    @formula
    def high_word(x: Number) -> Number:
        """Return x without the last 32 bits of its mantissa; products of two such numbers are exact."""
        return from_bits(bits(x) & HIGH_WORD)

    @formula
    def reduce(x: Number) -> Any:
        """Return the remainder of x by pi / 2, within +-pi / 4, its rounding error, and the quotient modulo 4.

        The argument is at most NEAR.
        """
        rounded = x * TWO_OVER_PI + ROUND
        q = rounded - ROUND
        first = x - q * HALF_PI_1
        product = q * HALF_PI_2
        second = first - product
        correction = q * HALF_PI_3 - ((first - second) - product)
        r = second - correction
        return r, (second - r) - correction, bits(rounded)

    @formula
    def sin_cos_of_remainder(r: Number, low: Number, quotient: Integer) -> Any:
        z = r * r
        w = z * z
        series = (SIN[1] + z * (SIN[2] + z * SIN[3])) + z * w * (SIN[4] + z * SIN[5])
        cube = z * r
        s = r - ((z * (0.5 * low - cube * series) - low) - cube * SIN[0])
        half = 0.5 * z
        near = 1.0 - half
        series = z * (COS[0] + z * (COS[1] + z * COS[2])) + w * w * (COS[3] + z * (COS[4] + z * COS[5]))
        c = near + (((1.0 - near) - half) + (z * series - r * low))
        is_even = (quotient & 1) == 0
        sine, cosine = where(is_even, s, c), where(is_even, c, s)
        return (
            where((quotient & 2) == 0, sine, -sine),
            where(((quotient + 1) & 2) == 0, cosine, -cosine),
        )

    @formula
    def near_sin(x: Number) -> Number:
        r, low, quotient = reduce(x)
        return sin_cos_of_remainder(r, low, quotient)[0]

    @formula
    def near_cos(x: Number) -> Number:
        r, low, quotient = reduce(x)
        return sin_cos_of_remainder(r, low, quotient)[1]

    @formula
    def sin_cos(x: Number) -> Any:
        is_finite, is_huge = abs(x) < INF, abs(x) > NEAR
        r, low, quotient = reduce_huge(is_finite & is_huge, x, reduce(where(is_huge, 0.0, x)))
        sine, cosine = sin_cos_of_remainder(r, low, quotient)
        return where(is_finite, sine, NAN), where(is_finite, cosine, NAN)

    @formula
    def sin(x: Number) -> Number:
        return sin_cos(x)[0]

    @formula
    def cos(x: Number) -> Number:
        return sin_cos(x)[1]

    @formula
    def tan(x: Number) -> Number:
        sine, cosine = sin_cos(x)
        return sine / cosine

    @formula
    def atan(x: Number) -> Number:
        t = abs(x)
        t = where(t < TWO_66, t, TWO_66)
        is_0, is_half, is_1, is_15 = t < 0.4375, t < 0.6875, t < 1.1875, t < 2.4375
        above = where(is_0, t, where(is_half, 2.0 * t - 1.0, where(is_1, t - 1.0, where(is_15, t - 1.5, -1.0))))
        below = where(is_0, 1.0, where(is_half, 2.0 + t, where(is_1, t + 1.0, where(is_15, 1.0 + 1.5 * t, t))))
        high = where(
            is_0, 0.0, where(is_half, ATAN_HALF, where(is_1, QUARTER_PI, where(is_15, ATAN_THREE_HALVES, HALF_PI)))
        )
        low = where(
            is_0,
            0.0,
            where(
                is_half,
                ATAN_HALF_LOW,
                where(is_1, ATAN_ONE_LOW, where(is_15, ATAN_THREE_HALVES_LOW, HALF_PI_LOW)),
            ),
        )
        r = above / below
        z = r * r
        w = z * z
        odd = z * (ATAN[0] + w * (ATAN[2] + w * (ATAN[4] + w * (ATAN[6] + w * (ATAN[8] + w * ATAN[10])))))
        even = w * (ATAN[1] + w * (ATAN[3] + w * (ATAN[5] + w * (ATAN[7] + w * ATAN[9]))))
        angle = high - ((r * (odd + even) - low) - r)
        angle = where(x < 0.0, -angle, where(x == 0.0, x, angle))
        return where(abs(x) <= INF, angle, NAN)

    @formula
    def atan2(y: Number, x: Number) -> Number:
        height, width = abs(y), abs(x)
        is_steep = height > width
        large, small = where(is_steep, height, width), where(is_steep, width, height)
        is_diagonal = small == INF  # then both are
        large, small = where(is_diagonal, 1.0, large), where(is_diagonal, 1.0, small)
        angle = atan(small / where(large == 0.0, 1.0, large))
        angle = where(is_steep, HALF_PI - (angle - HALF_PI_LOW), angle)
        angle = where(bits(x) < 0, PI - (angle - PI_LOW), angle)
        angle = where(bits(y) < 0, -angle, angle)
        return where((abs(x) <= INF) & (abs(y) <= INF), angle, NAN)

    @formula
    def asin_series(t: Number) -> Number:
        above = t * (ASIN_P[0] + t * (ASIN_P[1] + t * (ASIN_P[2] + t * (ASIN_P[3] + t * (ASIN_P[4] + t * ASIN_P[5])))))
        return above / (1.0 + t * (ASIN_Q[0] + t * (ASIN_Q[1] + t * (ASIN_Q[2] + t * ASIN_Q[3]))))

    @formula
    def asin(x: Number) -> Number:
        size = abs(x)
        is_valid = size <= 1.0
        size = where(is_valid, size, 0.0)
        is_small = size < 0.5
        t = where(is_small, size * size, (1.0 - size) * 0.5)
        root = sqrt(t)
        ratio = asin_series(t)
        word = high_word(root)
        divisor = root + word
        correction = (t - word * word) / where(divisor == 0.0, 1.0, divisor)
        middle = QUARTER_PI - ((2.0 * root * ratio - (HALF_PI_LOW - 2.0 * correction)) - (QUARTER_PI - 2.0 * word))
        large = HALF_PI - (2.0 * (root + root * ratio) - HALF_PI_LOW)
        angle = where(is_small, size + size * ratio, where(size > 0.975, large, middle))
        angle = where(x < 0.0, -angle, where(x == 0.0, x, angle))
        return where(is_valid, angle, NAN)

    return Trigonometric(sin_cos, near_sin, near_cos, sin, cos, tan, atan, atan2, asin)
