"""Formulas of exponentials, logarithms, powers and the error function, each written once for all kinds of numbers.

Formulas and coefficients are those of fdlibm 5.3 (Sun Microsystems, 1993 to 2004), with errors below 1 ulp; a power is
2 to the product of a logarithm in two parts, and hypot the plain formula with scaling. Both sides of every choice are
computed, so that compiled loops and arrays need no branches; arguments that a side cannot have are replaced before.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from swarmwire.comms.base.math.operations import HIGH_WORD, INF, NAN, ROUND, ROUND_BITS, Integer, Number, Operations

ONE_BITS, MANTISSA = 0x3FF0000000000000, 0xFFFFFFFFFFFFF
SMALLEST_NORMAL, TWO_54, TWO_70 = 2.0**-1022, 2.0**54, 2.0**70
LN2, LN2_HIGH, LN2_LOW = 6.93147180559945286227e-01, 6.93147180369123816490e-01, 1.90821492927058770002e-10
INVERSE_LN2 = 1.44269504088896338700e00
MAX_EXP, MIN_EXP = 709.782712893383973096, -745.13321910194110842
EXP = (
    *(1.66666666666666019037e-01, -2.77777777770155933842e-03, 6.61375632143793436117e-05),
    *(-1.65339022054652515390e-06, 4.13813679705723846039e-08),
)
EXPM1 = (
    *(-3.33333333333331316428e-02, 1.58730158725481460165e-03, -7.93650757867487942473e-05),
    *(4.00821782732936239552e-06, -2.01099218183624371326e-07),
)
LOG = (
    *(6.666666666666735130e-01, 3.999999999940941908e-01, 2.857142874366239149e-01, 2.222219843214978396e-01),
    *(1.818357216161805012e-01, 1.531383769920937332e-01, 1.479819860511658591e-01),
)
SQRT_2, SQRT_HALF = 1.41421356237309504880, 0.70710678118654752440
LOG10_2_HIGH, LOG10_2_LOW = 3.01029995663611771306e-01, 3.69423907715893078616e-13
INVERSE_LN10 = 4.34294481903251816668e-01
# log2 as a sum of two numbers, and 2 to such a sum, for powers
POWER = (
    *(5.99999999999994648725e-01, 4.28571428578550184252e-01, 3.33333329818377432918e-01),
    *(2.72728123808534006489e-01, 2.30660745775561754067e-01, 2.06975017800338417784e-01),
)
LOG2_15_HIGH, LOG2_15_LOW = 5.84962487220764160156e-01, 1.35003920212974897128e-08
TWO_THIRDS_LOG2E = 9.61796693925975554329e-01  # 2 / (3 ln 2), also as a sum
TWO_THIRDS_LOG2E_HIGH, TWO_THIRDS_LOG2E_LOW = 9.61796700954437255859e-01, -7.02846165095275826516e-09
LN2_WORD, LN2_WORD_LOW = 6.93147182464599609375e-01, -1.90465429995776804525e-09
# erfc
ERX = 8.45062911510467529297e-01
ERFC_1 = (
    (
        *(1.28379167095512558561e-01, -3.25042107247001499370e-01, -2.84817495755985104766e-02),
        *(-5.77027029648944159157e-03, -2.37630166566501626084e-05),
    ),
    (
        *(1.0, 3.97917223959155352819e-01, 6.50222499887672944485e-02, 5.08130628187576562776e-03),
        *(1.32494738004321644526e-04, -3.96022827877536812320e-06),
    ),
)
ERFC_2 = (
    (
        *(-2.36211856075265944077e-03, 4.14856118683748331666e-01, -3.72207876035701323847e-01),
        *(3.18346619901161753674e-01, -1.10894694282396677476e-01, 3.54783043256182359371e-02),
        -2.16637559486879084300e-03,
    ),
    (
        *(1.0, 1.06420880400844228286e-01, 5.40397917702171048937e-01, 7.18286544141962662868e-02),
        *(1.26171219808761642112e-01, 1.36370839120290507362e-02, 1.19844998467991074170e-02),
    ),
)
ERFC_3 = (
    (
        *(-9.86494403484714822705e-03, -6.93858572707181764372e-01, -1.05586262253232909814e01),
        *(-6.23753324503260060396e01, -1.62396669462573470355e02, -1.84605092906711035994e02),
        *(-8.12874355063065934246e01, -9.81432934416914548592e00),
    ),
    (
        *(1.0, 1.96512716674392571292e01, 1.37657754143519042600e02, 4.34565877475229228821e02),
        *(6.45387271733267880336e02, 4.29008140027567833386e02, 1.08635005541779435134e02),
        *(6.57024977031928170135e00, -6.04244152148580987438e-02),
    ),
)
ERFC_4 = (
    (
        *(-9.86494292470009928597e-03, -7.99283237680523006574e-01, -1.77579549177547519889e01),
        *(-1.60636384855821916062e02, -6.37566443368389627722e02, -1.02509513161107724954e03),
        -4.83519191608651397019e02,
    ),
    (
        *(1.0, 3.03380607434824582924e01, 3.25792512996573918826e02, 1.53672958608443695994e03),
        *(3.19985821950859553908e03, 2.55305040643316442583e03, 4.74528541206955367215e02),
        -2.24409524465858183362e01,
    ),
)


class Exponential(NamedTuple):
    """The functions for one kind of numbers."""

    exp: Callable[[Number], Number]
    expm1: Callable[[Number], Number]
    log: Callable[[Number], Number]
    log1p: Callable[[Number], Number]
    log10: Callable[[Number], Number]
    log2: Callable[[Number], Number]
    power: Callable[[Number, Number], Number]
    hypot: Callable[[Number, Number], Number]
    erfc: Callable[[Number], Number]


def define_exponential(operations: Operations) -> Exponential:  # noqa: PLR0915 - many short functions
    """Return the functions for numbers of one kind."""
    where, bits, from_bits, sqrt, _, formula = operations

    @formula
    def high_word(x: Number) -> Number:
        """Return x without the last 32 bits of its mantissa; products of two such numbers are exact."""
        return from_bits(bits(x) & HIGH_WORD)

    @formula
    def scale(x: Number, exponent: Integer) -> Number:
        """Return x 2^exponent, in two steps, since the power alone may be out of range."""
        half = exponent >> 1
        first = from_bits((half + 1023) << 52)
        return x * first * from_bits((exponent - half + 1023) << 52)

    @formula
    def round_(x: Number) -> Any:
        """Return the nearest whole number, as a float and as an integer."""
        rounded = x + ROUND
        return rounded - ROUND, bits(rounded) - ROUND_BITS

    @formula
    def exp_series(t: Number) -> Number:
        w = t * t
        return t * ((EXP[0] + t * EXP[1]) + w * ((EXP[2] + t * EXP[3]) + w * EXP[4]))

    @formula
    def exp_of_sum(x: Number, remainder: Number) -> Number:
        """Return e^(x + remainder), where remainder is at most the rounding error of x."""
        is_inside = (x <= MAX_EXP) & (x >= MIN_EXP)
        inside = where(is_inside, x, 0.0)
        k, n = round_(inside * INVERSE_LN2)
        high, low = inside - k * LN2_HIGH, k * LN2_LOW - remainder
        r = high - low
        t = r * r
        c = r - exp_series(t)
        y = scale(1.0 - ((low - (r * c) / (2.0 - c)) - high), n)
        return where(is_inside, y, where(x > 0.0, INF, where(x < 0.0, 0.0, NAN)))

    @formula
    def exp(x: Number) -> Number:
        return exp_of_sum(x, 0.0)

    @formula
    def expm1(x: Number) -> Number:
        is_inside = (x <= MAX_EXP) & (x >= -40.0)
        inside = where(is_inside, x, 0.0)
        k, n = round_(where(abs(inside) > 0.5 * LN2, inside * INVERSE_LN2, 0.0))
        high, low = inside - k * LN2_HIGH, k * LN2_LOW
        r = high - low
        c = (high - r) - low
        half = 0.5 * r
        z = r * half
        series = 1.0 + z * (EXPM1[0] + z * (EXPM1[1] + z * (EXPM1[2] + z * (EXPM1[3] + z * EXPM1[4]))))
        t = 3.0 - series * half
        e = z * ((series - t) / (6.0 - r * t))
        near = r - (r * e - z)
        e = (r * (e - c) - c) - z
        small = from_bits((where((n > 0) & (n < 1000), 1023 - n, 1023)) << 52)  # 2^-n
        far = where(
            (n > 0) & (n < 20),
            scale((1.0 - small) - (e - r), n),
            where((n >= 20) & (n < 57), scale((r - (e + small)) + 1.0, n), scale(1.0 - (e - r), n) - 1.0),
        )
        far = where(n == -1, 0.5 * (r - e) - 0.5, far)
        far = where(n == 1, where(r < -0.25, -2.0 * (e - (r + 0.5)), 1.0 + 2.0 * (r - e)), far)
        y = where(n == 0, where(x == 0.0, x, near), far)
        return where(is_inside, y, where(x > 0.0, INF, where(x < 0.0, -1.0, NAN)))

    @formula
    def log_split(x: Number) -> Any:
        """Return the exponent of a positive x, and its mantissa from sqrt(1/2) to sqrt(2)."""
        is_subnormal = x < SMALLEST_NORMAL
        pattern = bits(x * where(is_subnormal, TWO_54, 1.0))
        k = (pattern >> 52) - where(is_subnormal, 1077, 1023)
        mantissa = from_bits((pattern & MANTISSA) | ONE_BITS)
        is_large = mantissa > SQRT_2
        return where(is_large, k + 1, k) * 1.0, where(is_large, 0.5 * mantissa, mantissa)

    @formula
    def log_of_parts(k: Number, f: Number, correction: Number) -> Number:
        """Return k ln 2 + log(1 + f) + correction, f from sqrt(1/2) - 1 to sqrt(2) - 1."""
        s = f / (2.0 + f)
        z = s * s
        w = z * z
        odd = w * (LOG[1] + w * (LOG[3] + w * LOG[5]))
        series = odd + z * (LOG[0] + w * (LOG[2] + w * (LOG[4] + w * LOG[6])))
        half = 0.5 * f * f
        return k * LN2_HIGH - ((half - (s * (half + series) + (k * LN2_LOW + correction))) - f)

    @formula
    def with_edges(x: Number, y: Number, edge: float) -> Number:
        """Return the logarithm y, with its values at the `edge` of its domain, beyond it, and at infinity."""
        return where((x > edge) & (x < INF), y, where(x == edge, -INF, where(x == INF, INF, NAN)))

    @formula
    def log(x: Number) -> Number:
        k, mantissa = log_split(where((x > 0.0) & (x < INF), x, 1.0))
        return with_edges(x, log_of_parts(k, mantissa - 1.0, 0.0), 0.0)

    @formula
    def log1p(x: Number) -> Number:
        inside = where((x > -1.0) & (x < INF), x, 0.0)
        sum_ = 1.0 + inside
        correction = where(inside >= 1.0, 1.0 - (sum_ - inside), inside - (sum_ - 1.0)) / sum_
        k, mantissa = log_split(sum_)
        is_near = (inside > SQRT_HALF - 1.0) & (inside < SQRT_2 - 1.0)
        y = log_of_parts(
            where(is_near, 0.0, k), where(is_near, inside, mantissa - 1.0), where(is_near, 0.0, correction)
        )
        return with_edges(x, where(x == 0.0, x, y), -1.0)

    @formula
    def log10(x: Number) -> Number:
        k, mantissa = log_split(where((x > 0.0) & (x < INF), x, 1.0))
        y = (k * LOG10_2_LOW + INVERSE_LN10 * log_of_parts(0.0, mantissa - 1.0, 0.0)) + k * LOG10_2_HIGH
        return with_edges(x, y, 0.0)

    @formula
    def log2_in_parts(x: Number) -> Any:
        """Return log2 of a positive x as a sum, whose first part has no last 32 bits."""
        is_subnormal = x < SMALLEST_NORMAL
        pattern = bits(x * where(is_subnormal, TWO_54, 1.0))
        n = (pattern >> 52) - where(is_subnormal, 1077, 1023)
        mantissa = from_bits((pattern & MANTISSA) | ONE_BITS)
        is_middle = (mantissa >= 1.2247448713915890) & (mantissa < 1.7320508075688772)
        is_large = mantissa >= 1.7320508075688772
        n = where(is_large, n + 1, n) * 1.0
        a = where(is_large, 0.5 * mantissa, mantissa)
        base = where(is_middle, 1.5, 1.0)
        u, v = a - base, 1.0 / (a + base)
        s = u * v
        s_high = high_word(s)
        t_high = high_word(a + base)
        t_low = a - (t_high - base)
        s_low = v * ((u - s_high * t_high) - s_high * t_low)
        s2 = s * s
        r = s2 * s2 * (POWER[0] + s2 * (POWER[1] + s2 * (POWER[2] + s2 * (POWER[3] + s2 * (POWER[4] + s2 * POWER[5])))))
        r = r + s_low * (s_high + s)
        s2 = s_high * s_high
        t_high = high_word(3.0 + s2 + r)
        t_low = r - ((t_high - 3.0) - s2)
        u, v = s_high * t_high, s_low * t_high + t_low * s
        p_high = high_word(u + v)
        p_low = v - (p_high - u)
        z_high = TWO_THIRDS_LOG2E_HIGH * p_high
        z_low = TWO_THIRDS_LOG2E_LOW * p_high + p_low * TWO_THIRDS_LOG2E + where(is_middle, LOG2_15_LOW, 0.0)
        d_high = where(is_middle, LOG2_15_HIGH, 0.0)
        high = high_word(((z_high + z_low) + d_high) + n)
        return high, z_low - (((high - n) - d_high) - z_high)

    @formula
    def log2(x: Number) -> Number:
        high, low = log2_in_parts(where((x > 0.0) & (x < INF), x, 1.0))
        return with_edges(x, high + low, 0.0)

    @formula
    def exp2_of_parts(high: Number, low: Number) -> Number:
        """Return 2^(high + low) for a sum from -1,100 to 1,025."""
        k, n = round_(high + low)
        high = high - k
        t = high_word(low + high)
        u = t * LN2_WORD
        v = (low - (t - high)) * LN2 + t * LN2_WORD_LOW
        z = u + v
        w = v - (z - u)
        t = z * z
        c = z - exp_series(t)
        r = (z * c) / (c - 2.0) - (w + z * w)
        return scale(1.0 - (r - z), n)

    @formula
    def power(x: Number, y: Number) -> Number:
        is_inside = (x > 0.0) & (x < INF) & (abs(y) <= INF)
        t_high, t_low = log2_in_parts(where(is_inside, x, 1.0))
        factor = where(is_inside, y, 0.0)
        factor = where(factor > TWO_70, TWO_70, where(factor < -TWO_70, -TWO_70, factor))
        word = high_word(factor)
        low = (factor - word) * t_high + factor * t_low
        high = word * t_high
        z = low + high
        is_large, is_small = z >= 1024.0, z < -1076.0
        is_outside = is_large | is_small
        result = exp2_of_parts(where(is_outside, 0.0, high), where(is_outside, 0.0, low))
        result = where(is_large, INF, where(is_small, 0.0, result))
        edge = where(y > 0.0, x, where(y < 0.0, where(x == 0.0, INF, 0.0), NAN))
        edge = where((x >= 0.0) & (abs(y) <= INF), edge, NAN)
        result = where(is_inside, result, edge)
        return where((y == 0.0) | (x == 1.0), 1.0, result)

    @formula
    def hypot(x: Number, y: Number) -> Number:
        width, height = abs(x), abs(y)
        largest = where(width > height, width, height)
        factor = where(largest > 2.0**500, 2.0**-600, where(largest < 2.0**-500, 2.0**600, 1.0))
        back = where(largest > 2.0**500, 2.0**600, where(largest < 2.0**-500, 2.0**-600, 1.0))
        is_infinite, is_finite = (width == INF) | (height == INF), (width < INF) & (height < INF)
        a, b = where(is_finite, width * factor, 0.0), where(is_finite, height * factor, 0.0)
        root = sqrt(a * a + b * b)
        is_infinite = is_infinite | ((largest > 2.0**500) & (root >= 2.0**424))
        return where(is_infinite, INF, where(is_finite, where(is_infinite, 0.0, root) * back, NAN))

    @formula
    def ratio_of_series(x: Number, parts: Any) -> Number:
        above, below = parts[0], parts[1]
        p, q = above[len(above) - 1] + 0.0 * x, below[len(below) - 1] + 0.0 * x
        for i in range(len(above) - 2, -1, -1):
            p = p * x + above[i]
        for i in range(len(below) - 2, -1, -1):
            q = q * x + below[i]
        return p / q

    @formula
    def erfc(x: Number) -> Number:
        size = abs(x)
        size = where(size < 28.0, size, 28.0)
        # up to 0.84375
        near = where(size < 0.84375, x, 0.0)
        r = near * ratio_of_series(near * near, ERFC_1)
        first = where(near < 0.5, 1.0 - (near + r), (1.0 - near) - r)
        # up to 1.25
        middle = ratio_of_series(where(size < 1.25, size, 1.0) - 1.0, ERFC_2)
        second = where(x < 0.0, 1.0 + (ERX + middle), (1.0 - ERX) - middle)
        # beyond
        far = where(size < 1.25, 1.25, size)
        s = 1.0 / (far * far)
        series = where(far < 1.0 / 0.35, ratio_of_series(s, ERFC_3), ratio_of_series(s, ERFC_4))
        z = high_word(far)
        square, remainder = -z * z - 0.5625, (z - far) * (z + far) + series  # the square is exact
        exponent = square + remainder
        tail = exp_of_sum(exponent, (square - exponent) + remainder) / far
        third = where(x < 0.0, where(x < -6.0, 2.0, 2.0 - tail), where(x < 28.0, tail, 0.0))
        y = where(size < 0.84375, first, where(size < 1.25, second, third))
        return where(abs(x) <= INF, y, NAN)

    return Exponential(exp, expm1, log, log1p, log10, log2, power, hypot, erfc)
