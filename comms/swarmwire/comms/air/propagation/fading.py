"""Fast fading: the power gain g of a link, mean 1, by how its waves arrive. See `scattering` for what moves it."""

# pyright: basic, reportUnknownMemberType=false

import math
from typing import NamedTuple

from numba import njit

from swarmwire.comms.air.parameters.propagation import FADINGS, Fading
from swarmwire.comms.air.propagation.loss_curve import SPEED_OF_LIGHT_MPS
from swarmwire.comms.air.propagation.nakagami import nakagami_gain
from swarmwire.comms.air.propagation.scattering import scattered_between
from swarmwire.comms.air.propagation.waves import cosine, sine
from swarmwire.comms.borrowing import borrowing

RAYLEIGH, RICIAN, NAKAGAMI = range(len(FADINGS))


class FadingLaw(NamedTuple):
    """A distribution's numbers, as kernels take them."""

    distribution: int
    k: float
    m: float
    wave_number: float  # 1 / wavelength, in cycles per m


def fading_law(fading: Fading, frequency_hz: float, speed_mps: float = SPEED_OF_LIGHT_MPS) -> FadingLaw:
    """The law at this frequency of waves with this speed."""
    kind = FADINGS.index(fading.distribution)
    return FadingLaw(kind, fading.k, fading.m, frequency_hz / speed_mps)


@njit(cache=True)
def fading_gain(law, key, a, b, ax, ay, bx, by):
    """Power gain between robots a and b, indices in the arena with this key, at (ax, ay) and (bx, by) in m.

    A ratio, mean 1; equal both ways to the last bit. For many links between few robots see `gain_of`.
    """
    h = scattered_between(key, law.wave_number, a, b, ax, ay, bx, by)
    return gain_of(law, h, math.sqrt((bx - ax) ** 2 + (by - ay) ** 2))


@borrowing()
def gain_of(law, h, distance_m):
    """The gain by the law, of `scattered`'s h between robots so many m apart; a ratio, mean 1."""
    real, imaginary = h
    if law.distribution == RICIAN:
        return rician_gain(real, imaginary, law.k, law.wave_number * distance_m)
    gain = real * real + imaginary * imaginary
    return nakagami_gain(gain, law.m) if law.distribution == NAKAGAMI else gain


@njit(cache=True)
def rician_gain(real, imaginary, k, path):
    """Rice's gain: beside the scattered waves a direct one, with k >= 0 times their power.

    Its phase is its path's length in wavelengths. k = 0 is Rayleigh.
    """
    direct, others = math.sqrt(k / (k + 1.0)), math.sqrt(1.0 / (k + 1.0))
    real = direct * cosine(path) + others * real
    imaginary = direct * sine(path) + others * imaginary
    return real * real + imaginary * imaginary
