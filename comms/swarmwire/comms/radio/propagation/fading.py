"""Fast fading: the power gain g of a link, mean 1, by Rayleigh, Rice or Nakagami.

The gain varies over fractions of a wavelength: waves arrive over many paths and add up or cancel. g is the power of a
sum h of N plane waves in the positions of both robots of the link,

    h = 1/sqrt(N) sum_n exp(2 pi i (u_n . x_a / lambda + v_n . x_b / lambda + phase_n)),     g = |h|^2,

with unit vectors u_n and v_n in all directions (Clarke, Bell Syst. Tech. J. 47, 1968; both ends moving: Akki and Haber,
IEEE Trans. Vehicular Techn. 35, 1986). So no link has a state, both directions agree, and a packet's gain does not
depend on earlier packets. While one end moves by s, the correlation of h is J0(2 pi s / lambda), Jakes' spectrum; while
both move, it is the product.

The directions are a lattice of N points over both circles, rotated by keyed amounts at either robot, and each wave has
a keyed phase, all by the arena's key. Each unordered pair of robots gives each wave a sign, by keyed numbers of both
robots, which makes pairs independent. So the waves at a robot are computed once for all its links. |h|^2 is
exponential up to O(1/N): E g^2 = 2 - 1/N, its distribution is within 0.004 of the exponential's, and it never exceeds N
(15 dB). Waves travel in the plane: height does not change h, only the phase of Rice's direct wave.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import AnyArray
from swarmwire.comms.base.draws import purpose
from swarmwire.comms.base.draws_compiled import uniform
from swarmwire.comms.base.kernels import kernel, njit
from swarmwire.comms.base.math import compiled as math_compiled
from swarmwire.comms.radio.config.path_loss_models import SPEED_OF_LIGHT_MPS
from swarmwire.comms.radio.config.phy import FADINGS, Fading
from swarmwire.comms.radio.propagation.shadowing import SUMS, cosine, sine, total

MAX_TERMS = 1000
MAX_STEPS = 60
PRECISION = 1e-16
SMALLEST = 1e-300
WAVES = 2 * SUMS  # unrolled in `scattered_field`
GENERATOR = 19  # index of v / index of u: near the golden section of WAVES, and coprime to WAVES
SCALE = np.float64(1.0 / math.sqrt(WAVES))  # a plain float would keep float32 sums single without numba
FADING = purpose("fading")
TURN_U, TURN_V, PHASE, ROBOT_NUMBER = range(4)  # indices of the draws
RAYLEIGH, RICIAN, NAKAGAMI = range(len(FADINGS))
_MIX = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB), np.uint64(0x9E3779B97F4A7C15)


@njit()
def gamma_tails(shape: Any, x: float):
    """Return P(X <= x) and P(X > x) of X ~ Gamma(shape, 1), x >= 0.

    The smaller one is exact to 1e-13 relative for shapes up to 200. A series below shape + 1, above it the continued
    fraction by Lentz's method (Abramowitz and Stegun 6.5.29, 6.5.31).
    """
    if x <= 0.0:
        return 0.0, 1.0
    scale = math_compiled.exp(shape * math_compiled.log(x) - x - math_compiled.log_gamma(shape))
    if x < shape + 1.0:
        term = 1.0 / shape
        below = term
        for n in range(1, MAX_TERMS):
            term *= x / (shape + n)
            below += term
            if term < below * PRECISION:
                break
        below = min(below * scale, 1.0)
        return below, 1.0 - below
    b = x + 1.0 - shape
    c, d = 1.0 / SMALLEST, 1.0 / b
    fraction = d
    for n in range(1, MAX_TERMS):
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


@njit()
def gamma_quantile(shape: Any, below: Any, above: Any):
    """Return x with P(X <= x) = below = 1 - above, X ~ Gamma(shape, 1); to 1e-11 relative for shapes from 0.5 to 200.

    Both tails are arguments, and the smaller one counts, so that neither end loses digits. Newton's steps with Halley's
    correction (Press et al., Numerical Recipes, 3rd ed., 6.2.1), limited to the bracket of the root.
    """
    if below <= 0.0:
        return 0.0
    if above <= 0.0:
        return math.inf
    low, high = 0.0, math.inf
    x = _first_guess(shape, below, above)
    log_scale = math_compiled.log_gamma(shape)
    for _ in range(MAX_STEPS):
        below_x, above_x = gamma_tails(shape, x)
        excess = below_x - below if below < above else above - above_x
        if excess > 0.0:
            high = x
        else:
            low = x
        density = math_compiled.exp((shape - 1.0) * math_compiled.log(x) - x - log_scale)
        step = excess / density if density > 0.0 else math.inf
        curvature = (shape - 1.0) / x - 1.0
        x_next = x - step / (1.0 - 0.5 * min(1.0, step * curvature))
        if not low < x_next < high:
            x_next = 0.5 * (low + high) if high < math.inf else 2.0 * x
        if abs(x_next - x) <= 1e-12 * x:
            return x_next
        x = x_next
    return x


@njit()
def _first_guess(shape: Any, below: Any, above: Any):
    """Return a guess: a normal quantile above shape 1 (Wilson and Hilferty, 1931), the ends' asymptotes below."""
    if shape > 1.0:
        t = math.sqrt(-2.0 * math_compiled.log(min(below, above)))
        z = t - (2.30753 + t * 0.27061) / (1.0 + t * (0.99229 + t * 0.04481))  # Abramowitz and Stegun 26.2.22
        z = -z if below < above else z
        root = 1.0 - 1.0 / (9.0 * shape) + z / (3.0 * math.sqrt(shape))
        if root > 0.1:
            return shape * root**3
        return math_compiled.exp((math_compiled.log(below) + math_compiled.log_gamma(shape + 1.0)) / shape)
    split = 1.0 - shape * (0.253 + shape * 0.12)
    if below < split:
        return max(math_compiled.power(below / split, 1.0 / shape), SMALLEST)
    return 1.0 - math_compiled.log(above / (1.0 - split))


@njit()
def nakagami_gain(rayleigh_gain: Any, m: float):
    """Return the Nakagami-m power gain with the same cumulative probability as a Rayleigh gain; m >= 0.5.

    m = 1 is Rayleigh's; fading is worse for m < 1 and vanishes for large m. g = Q(F(r)), with r Rayleigh's gain, F its
    distribution and Q the quantile of Gamma(m, 1/m): mean 1, variance 1/m, and the correlation of r in time (M.
    Nakagami, 1960; by quantiles: Beaulieu and Cheng, IEEE Trans. Vehicular Techn. 54, 2005). About 0.5 us; nothing for
    m = 1.
    """
    if m == 1.0:
        return rayleigh_gain
    return gamma_quantile(m, -math_compiled.expm1(-rayleigh_gain), math_compiled.exp(-rayleigh_gain)) / m


@njit()
def scatter_waves(key: Any, wave_number: Any):
    """Return the waves of the arena with this key, (5, WAVES): u and v as x, y in cycles per m, and phases in turns.

    `wave_number` is 1 / lambda in cycles per m.
    """
    waves = np.empty((5, WAVES))
    turn_u, turn_v = uniform(key, 0, 0, TURN_U, FADING), uniform(key, 0, 0, TURN_V, FADING)
    for n in range(WAVES):
        u, v = n / WAVES + turn_u, n * GENERATOR / WAVES + turn_v
        waves[0, n], waves[1, n] = wave_number * cosine(u), wave_number * sine(u)
        waves[2, n], waves[3, n] = wave_number * cosine(v), wave_number * sine(v)
        waves[4, n] = uniform(key, n, 0, PHASE, FADING)
    return waves


@njit(error_model="numpy")
def waves_at(waves: AnyArray, x: float, y: float, out: AnyArray):
    """Write the waves u and v at (x, y) in m to `out` (4, WAVES): real and imaginary parts of u, then of v."""
    for n in range(WAVES):
        u = waves[0, n] * x + waves[1, n] * y + waves[4, n]
        v = waves[2, n] * x + waves[3, n] * y
        out[0, n], out[1, n] = cosine(u), sine(u)
        out[2, n], out[3, n] = cosine(v), sine(v)


@njit()
def robot_number(key: Any, robot: int):
    """Return a robot's keyed number, 53 random bits."""
    return np.uint64(uniform(key, robot, 0, ROBOT_NUMBER, FADING) * 2.0**53)


@njit()
def pair_signs(number_a: Any, number_b: Any):
    """Return 64 random bits of a pair: SplitMix64 of its robots' numbers (Steele et al., OOPSLA 2014)."""
    z = number_a * _MIX[2] + number_b
    z = (z ^ (z >> np.uint64(30))) * _MIX[0]
    z = (z ^ (z >> np.uint64(27))) * _MIX[1]
    return z ^ (z >> np.uint64(31))


@kernel(error_model="numpy")
def scattered_field(signs: Any, arriving: Any, a: Any, b: Any, real: AnyArray, imaginary: AnyArray):
    """Return real and imaginary part of h for robots a < b (indices in the arena); 0.013 us.

    `signs` are those of the pair, `arriving` (rows, 4, WAVES) the waves at robots, with rows a and b; `real` and
    `imaginary` (SUMS,) are scratch space.
    """
    half, a, b = np.uint32(signs >> np.uint64(WAVES)), np.uint64(a), np.uint64(b)
    for n in range(SUMS):
        low_real, low_imaginary = _wave(half, arriving, a, b, np.uint64(n))
        high_real, high_imaginary = _wave(half, arriving, a, b, np.uint64(n + SUMS))
        real[n], imaginary[n] = low_real + high_real, low_imaginary + high_imaginary
    return total(real) * SCALE, total(imaginary) * SCALE


@kernel(error_model="numpy")
def _wave(half: int, arriving: AnyArray, a: int, b: int, n: int):
    sign = np.float32(1) - np.float32(2) * np.float32((half >> np.uint32(n)) & np.uint32(1))
    u_real, u_imaginary = arriving[a, 0, n], arriving[a, 1, n]
    v_real, v_imaginary = arriving[b, 2, n], arriving[b, 3, n]
    return sign * (u_real * v_real - u_imaginary * v_imaginary), sign * (u_real * v_imaginary + u_imaginary * v_real)


@njit()
def scattered_between(key: Any, wave_number: Any, a: Any, b: Any, ax: Any, ay: Any, bx: Any, by: Any):
    """Return `scattered_field` of one link: robots a and b of the arena with this key, at (ax, ay), (bx, by) in m."""
    if b < a:
        a, ax, ay, b, bx, by = b, bx, by, a, ax, ay
    arriving, parts = np.empty((2, 4, WAVES), np.float32), np.empty((2, SUMS), np.float32)
    waves = scatter_waves(key, wave_number)
    waves_at(waves, ax, ay, arriving[0])
    waves_at(waves, bx, by, arriving[1])
    signs = pair_signs(robot_number(key, a), robot_number(key, b))
    return scattered_field(signs, arriving, 0, 1, parts[0], parts[1])


class FadingModel(NamedTuple):
    """Parameters of a fading distribution, an input of kernels."""

    distribution: int
    k: float
    m: float
    wave_number: float  # 1 / wavelength, in cycles per m


def fading_model(fading: Fading, frequency_hz: float, speed_mps: float = SPEED_OF_LIGHT_MPS) -> FadingModel:
    """Return the model at this frequency, for waves of this speed."""
    kind = FADINGS.index(fading.distribution)
    return FadingModel(kind, fading.k, fading.m, frequency_hz / speed_mps)


@njit()
def fading_gain(law: Any, key: Any, a: int, b: int, ax: float, ay: float, bx: float, by: float):
    """Return the power gain between robots a and b of the arena with this key, at (ax, ay) and (bx, by) in m.

    A ratio, mean 1; equal both ways to the last bit. For many links between few robots see `field_gain`.
    """
    h = scattered_between(key, law.wave_number, a, b, ax, ay, bx, by)
    return field_gain(law, h, math.sqrt((bx - ax) ** 2 + (by - ay) ** 2))


@kernel()
def field_gain(law: Any, h: Any, distance_m: float):
    """Return the power gain of the scattered field h between robots `distance_m` apart; a ratio, mean 1."""
    real, imaginary = h
    if law.distribution == RICIAN:
        return rician_gain(real, imaginary, law.k, law.wave_number * distance_m)
    gain = real * real + imaginary * imaginary
    return nakagami_gain(gain, law.m) if law.distribution == NAKAGAMI else gain


@njit()
def rician_gain(real: Any, imaginary: Any, k: int, path: Any):
    """Return Rice's power gain: a direct wave of k >= 0 times the power of the scattered waves is added to them.

    Its phase is `path`, the length of its path in wavelengths. k = 0 is Rayleigh.
    """
    direct, others = math.sqrt(k / (k + 1.0)), math.sqrt(1.0 / (k + 1.0))
    real = direct * cosine(path) + others * real
    imaginary = direct * sine(path) + others * imaginary
    return real * real + imaginary * imaginary
