"""Shadowing: a Gaussian field per arena models the surroundings, and each link integrates it along its path.

The model NeSh (P. Agrawal and N. Patwari, IEEE Trans. Wireless Comm. 8, 2009): a field p over the plane with E[p(x)
p(y)] = sigma^2 / (2 delta) exp(-|x - y| / delta), and on a link of length d from a to b

    X = 1/sqrt(d) * integral of p along the link, in dB;   Var X = sigma^2 (1 - delta/d (1 - exp(-d/delta))).

Both directions agree, a robot that returns gets the same value, links through the same region are correlated, and the
shadowing of short links vanishes. Var X tends to sigma^2 for links much longer than delta. Heights have no effect: a
link has the shadowing of its line over the floor.

p is a sum of plane waves, sqrt(sigma^2 / (delta N)) cos(2 pi (k . x + phase)), whose integral has a closed form. The
covariance is exact if the wave vectors follow its spectrum: |k| with F(k) = 1 - 1/sqrt(1 + (2 pi delta k)^2) (the
plane's Fourier transform of the exponential), and all directions equally likely. The N quantiles of |k| are stratified,
and directions turn by the golden section from one to the next: with 128 waves each single arena then varies about as
the model demands.

Sine and cosine of phases in turns are one polynomial: + - * only, so that compilers vectorize them. The sums need many
per link; the mathematical library's would take ten times as long.
"""

import math
from typing import Any

import numpy as np

from swarmwire.comms.base import math as portable
from swarmwire.comms.base.arrays import AnyArray, FloatArray, KeyArray
from swarmwire.comms.base.draws import purpose, uniform
from swarmwire.comms.base.kernels import kernel, njit
from swarmwire.comms.radio.config.phy import Shadowing

SUMS = 16  # `total` is unrolled for this number of terms
WAVES = 8 * SUMS  # unrolled in `between_db`
MIN_SQUARE_TURNS = np.float32(1e-30)  # no division by 0 for links of length 0
GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
SHADOWING = purpose("shadowing")
QUANTILE, PHASE, TURN = 0, 1, 2  # indices of the draws of an arena
# Taylor series of sin(2 pi y) in y, up to y^21: for |y| <= 1/2 the next term is 1e-11.
_A, _B, _C, _D, _E, _F, _G, _H, _I, _J, _K = (
    (-1.0) ** n * (2.0 * math.pi) ** (2 * n + 1) / math.factorial(2 * n + 1) for n in range(11)
)


@njit(inline="always", error_model="numpy")
def _series(y: float):
    z = y * y
    high = _F + z * (_G + z * (_H + z * (_I + z * (_J + z * _K))))
    return y * (_A + z * (_B + z * (_C + z * (_D + z * (_E + z * high)))))


@njit(inline="always", error_model="numpy")
def sine(turns: Any):
    """Return sin(2 pi x) of x in turns, to 2e-11 + 1e-15 |x|; odd in x to the last bit."""
    return _series(turns - np.rint(turns))


@njit(inline="always", error_model="numpy")
def cosine(turns: Any):
    """Return cos(2 pi x) of x in turns, to 2e-11 + 1e-15 |x|; even in x to the last bit."""
    return _series(0.25 - abs(turns - np.rint(turns)))


@kernel(error_model="numpy")
def total(s: AnyArray):
    """Return the sum of SUMS numbers by halves, s[n] + s[n + 8] first; s[n] is the partial sum of every 16th term."""
    even = ((s[0] + s[8]) + (s[4] + s[12])) + ((s[2] + s[10]) + (s[6] + s[14]))
    odd = ((s[1] + s[9]) + (s[5] + s[13])) + ((s[3] + s[11]) + (s[7] + s[15]))
    return even + odd


def field_waves(keys: KeyArray, shadowing: Shadowing) -> FloatArray:
    """Return the waves of each arena's field (arenas, 3, WAVES): k_x and k_y in cycles per m, phase in turns."""
    key, wave = keys[:, None], np.arange(WAVES)
    quantile = (wave + uniform(key, wave, QUANTILE, 0, SHADOWING)) / WAVES
    k = np.sqrt(1.0 / ((1.0 - quantile) * (1.0 - quantile)) - 1.0) / (2.0 * np.pi * shadowing.correlation_m)
    direction = 2.0 * np.pi * (wave * GOLDEN + uniform(key, 0, TURN, 0, SHADOWING))
    return np.stack(
        [k * portable.cos(direction), k * portable.sin(direction), uniform(key, wave, PHASE, 0, SHADOWING)], axis=1
    )


def amplitude_db(shadowing: Shadowing) -> float:
    """Return the amplitude of each wave, in dB per sqrt(m)."""
    return shadowing.deviation_db / math.sqrt(shadowing.correlation_m * WAVES)


@njit()
def shadowing_db(waves: AnyArray, amplitude_db: float, ax: float, ay: float, bx: float, by: float):
    """Return the shadowing X in dB, a loss, between (ax, ay) and (bx, by) in m; equal both ways to the last bit.

    `waves` (3, WAVES) are those of one arena. For many links between few robots see `heights` and `between_db`.
    """
    height = np.empty((2, WAVES))
    heights(waves, ax, ay, height[0])
    heights(waves, bx, by, height[1])
    return between_db(waves.reshape((1, 3, -1)), 0, amplitude_db, height, 0, 1, bx - ax, by - ay, np.empty(SUMS))


@njit(error_model="numpy")
def heights(waves: AnyArray, x: float, y: float, out: AnyArray):
    """Write the sine of each wave at (x, y) in m, an end of a link's integral, to `out` (WAVES,)."""
    for n in range(len(out)):
        out[n] = sine(waves[0, n] * x + waves[1, n] * y + waves[2, n])


@kernel(error_model="numpy")
def between_db(
    field: Any, arena: int, amplitude_db: float, height: Any, a: int, b: int, dx: float, dy: float, parts: AnyArray
):
    """Return the shadowing X in dB between robots a and b, rows of `height` (robots, WAVES), b at (dx, dy) m from a.

    `field` (arenas, 3, WAVES) are the waves of all arenas. A wave's mean along the link is the difference of its sines
    at the ends / the difference of its phases. `parts` (SUMS,) is scratch space. 0.016 us in single precision, if all
    arrays and distances have it.
    """
    link = field, np.uint64(arena), height, np.uint64(a), np.uint64(b), dx, dy
    for n in range(SUMS):
        even = (_mean(link, n) + _mean(link, n + 4 * SUMS)) + (_mean(link, n + 2 * SUMS) + _mean(link, n + 6 * SUMS))
        odd = (_mean(link, n + SUMS) + _mean(link, n + 5 * SUMS)) + (
            _mean(link, n + 3 * SUMS) + _mean(link, n + 7 * SUMS)
        )
        parts[n] = even + odd
    return total(parts) * (amplitude_db / (2.0 * math.pi)) * math.sqrt(math.sqrt(dx * dx + dy * dy))


@kernel(error_model="numpy")
def _mean(link: Any, wave: Any):
    field, arena, height, a, b, dx, dy = link
    n = np.uint64(wave)
    turns = field[arena, 0, n] * dx + field[arena, 1, n] * dy
    return (height[b, n] - height[a, n]) * turns / (turns * turns + MIN_SQUARE_TURNS)
