"""Fast fading: the power gain g of a link, mean 1, by how its waves arrive. See `scattering` for what moves it."""

# pyright: basic, reportUnknownMemberType=false

import math
from typing import NamedTuple

from numba import njit

from swarmwire.comms.air.propagation.loss_curve import SPEED_OF_LIGHT_MPS
from swarmwire.comms.air.propagation.nakagami import nakagami_gain
from swarmwire.comms.air.propagation.parameters import FADINGS, Fading
from swarmwire.comms.air.propagation.scattering import scattered
from swarmwire.comms.air.propagation.waves import cosine, sine

_, RICIAN, NAKAGAMI = range(len(FADINGS))


class FadingLaw(NamedTuple):
    """A distribution's numbers, as kernels take them."""

    distribution: int
    k: float
    m: float
    wave_number: float  # 1 / wavelength, in cycles per m


def fading_law(fading: Fading, frequency_hz: float) -> FadingLaw:
    """The law at this frequency."""
    kind = FADINGS.index(fading.distribution)
    return FadingLaw(kind, fading.k, fading.m, frequency_hz / SPEED_OF_LIGHT_MPS)


@njit(cache=True)
def fading_gain(law, key, a, b, ax, ay, bx, by):
    """Power gain between robots a and b, indices in the arena with this key, at (ax, ay) and (bx, by) in m.

    A ratio, mean 1; equal both ways to the last bit.
    """
    if law.distribution == RICIAN:
        return rician_gain(key, a, b, law.wave_number, ax, ay, bx, by, law.k)
    gain = rayleigh_gain(key, a, b, law.wave_number, ax, ay, bx, by)
    return nakagami_gain(gain, law.m) if law.distribution == NAKAGAMI else gain


@njit(cache=True)
def rayleigh_gain(key, a, b, wave_number, ax, ay, bx, by):
    """Power gain without line of sight: exponential, mean 1. Robots a and b in either order, equal to the last bit."""
    if b < a:
        a, ax, ay, b, bx, by = b, bx, by, a, ax, ay
    real, imaginary = scattered(key, a, b, wave_number, ax, ay, bx, by)
    return real * real + imaginary * imaginary


@njit(cache=True)
def rician_gain(key, a, b, wave_number, ax, ay, bx, by, k):
    """Power gain with a direct wave that carries k >= 0 times the power of all others: Rice's, mean 1.

    The direct wave's phase is its path's length in wavelengths. k = 0 is Rayleigh.
    """
    if b < a:
        a, ax, ay, b, bx, by = b, bx, by, a, ax, ay
    real, imaginary = scattered(key, a, b, wave_number, ax, ay, bx, by)
    direct, others = math.sqrt(k / (k + 1.0)), math.sqrt(1.0 / (k + 1.0))
    path = wave_number * math.sqrt((bx - ax) ** 2 + (by - ay) ** 2)
    real = direct * cosine(path) + others * real
    imaginary = direct * sine(path) + others * imaginary
    return real * real + imaginary * imaginary
