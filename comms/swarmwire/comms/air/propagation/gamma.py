"""The gamma distribution: its two tails, and its quantile."""

# pyright: basic, reportUnknownMemberType=false

import math

from numba import njit

MOST_TERMS = 1000
MOST_STEPS = 60
PRECISION = 1e-16
SMALLEST = 1e-300


@njit(cache=True)
def gamma_tails(shape, x):
    """P(X <= x) and P(X > x) of X ~ Gamma(shape, 1), x >= 0; the smaller one to 1e-13 relative for shapes up to 200.

    Series below shape + 1, above it the continued fraction by Lentz's method (Abramowitz and Stegun 6.5.29, 6.5.31).
    """
    if x <= 0.0:
        return 0.0, 1.0
    scale = math.exp(shape * math.log(x) - x - math.lgamma(shape))
    if x < shape + 1.0:
        term = 1.0 / shape
        below = term
        for n in range(1, MOST_TERMS):
            term *= x / (shape + n)
            below += term
            if term < below * PRECISION:
                break
        below = min(below * scale, 1.0)
        return below, 1.0 - below
    b = x + 1.0 - shape
    c, d = 1.0 / SMALLEST, 1.0 / b
    fraction = d
    for n in range(1, MOST_TERMS):
        a = -n * (n - shape)
        b += 2.0
        d = a * d + b
        d = 1.0 / (d if abs(d) > SMALLEST else SMALLEST)
        c = b + a / c
        c = c if abs(c) > SMALLEST else SMALLEST
        fraction *= c * d
        if abs(c * d - 1.0) < PRECISION:
            break
    above = min(fraction * scale, 1.0)
    return 1.0 - above, above


@njit(cache=True)
def gamma_quantile(shape, below, above):
    """The x with P(X <= x) = below = 1 - above, X ~ Gamma(shape, 1); to 1e-11 relative for shapes from 0.5 to 200.

    Both tails are given, so that neither end loses digits: the smaller one counts. Newton's steps with Halley's
    correction (Press et al., Numerical Recipes, 3rd ed., 6.2.1), kept within what is known to hold the root.
    """
    if below <= 0.0:
        return 0.0
    if above <= 0.0:
        return math.inf
    low, high = 0.0, math.inf
    x = _start(shape, below, above)
    log_scale = math.lgamma(shape)
    for _ in range(MOST_STEPS):
        found_below, found_above = gamma_tails(shape, x)
        excess = found_below - below if below < above else above - found_above
        if excess > 0.0:
            high = x
        else:
            low = x
        density = math.exp((shape - 1.0) * math.log(x) - x - log_scale)
        step = excess / density if density > 0.0 else math.inf
        curvature = (shape - 1.0) / x - 1.0
        x_next = x - step / (1.0 - 0.5 * min(1.0, step * curvature))
        if not low < x_next < high:
            x_next = 0.5 * (low + high) if high < math.inf else 2.0 * x
        if abs(x_next - x) <= 1e-12 * x:
            return x_next
        x = x_next
    return x


@njit(cache=True)
def _start(shape, below, above):
    """A first guess: by a normal quantile above shape 1 (Wilson and Hilferty, 1931), by the ends' asymptotes below."""
    if shape > 1.0:
        t = math.sqrt(-2.0 * math.log(min(below, above)))
        z = t - (2.30753 + t * 0.27061) / (1.0 + t * (0.99229 + t * 0.04481))  # Abramowitz and Stegun 26.2.22
        z = -z if below < above else z
        root = 1.0 - 1.0 / (9.0 * shape) + z / (3.0 * math.sqrt(shape))
        if root > 0.1:
            return shape * root**3
        return math.exp((math.log(below) + math.lgamma(shape + 1.0)) / shape)
    split = 1.0 - shape * (0.253 + shape * 0.12)
    if below < split:
        return max((below / split) ** (1.0 / shape), SMALLEST)
    return 1.0 - math.log(above / (1.0 - split))
