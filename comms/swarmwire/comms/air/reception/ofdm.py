"""IEEE 802.11a/g: OFDM at 6 to 54 Mbit/s in 20 MHz, with convolutional codes.

The NIST model, as in ns-3 (G. Pei and T. R. Henderson, Validation of OFDM error rate model in ns-3, 2010): errors of
the raw bits by modulation, then the union bound over the weight spectrum of the code (K = 7, generators 133 and 171).
"""

# pyright: basic, reportUnknownMemberType=false

import math

import numpy as np
from numba import njit

from swarmwire.comms.air.reception.bits import all_right
from swarmwire.comms.air.timing.airtime import OFDM_BITS_PER_SYMBOL

RATES_BPS = tuple(OFDM_BITS_PER_SYMBOL)
# By rate: points of the constellation, and the code of SPECTRA.
_POINTS = (2, 2, 4, 4, 16, 16, 64, 64)
_CODE = (0, 2, 0, 2, 0, 2, 1, 2)
# Rates 1/2, 2/3 and 3/4: first exponent of D, its step, the factor before the sum, and the coefficients.
SPECTRA = (
    (10, 2, 1 / 2, (36, 211, 1404, 11633, 77433, 502690, 3322763, 21292910, 134365911)),
    (6, 1, 1 / 4, (3, 70, 285, 1276, 6160, 27128, 117019, 498860, 2103891, 8784123)),
    (5, 1, 1 / 6, (42, 201, 1492, 10469, 62935, 379644, 2253373, 13073811, 75152755, 428005675)),
)
_FIRST = tuple(spectrum[0] for spectrum in SPECTRA)
_STEP = tuple(spectrum[1] for spectrum in SPECTRA)
_COEFFICIENTS = np.zeros((3, 10))
for _code, (_, _, _factor, _weights) in enumerate(SPECTRA):
    _COEFFICIENTS[_code, : len(_weights)] = np.multiply(_factor, _weights)


@njit(cache=True)
def raw_bit_errors(points, sinr):
    """The share of bits that are wrong before decoding, by the points of the constellation; s = SINR in 20 MHz.

    BPSK 1/2 erfc(sqrt s), QPSK 1/2 erfc(sqrt(s / 2)), M-QAM with L = sqrt M
    (L - 1) / (L log2 L) erfc(sqrt(3 s / (2 (M - 1)))).
    """
    if points == 2:
        return 0.5 * math.erfc(math.sqrt(sinr))
    if points == 4:
        return 0.5 * math.erfc(math.sqrt(0.5 * sinr))
    side = math.sqrt(points)
    return (side - 1.0) / (side * math.log2(side)) * math.erfc(math.sqrt(1.5 * sinr / (points - 1.0)))


@njit(cache=True)
def ofdm_bit_errors(rate, sinr):
    """The bound after decoding, at one of RATES_BPS by index: sum of coefficient x D^exponent, at most 1.

    D = sqrt(4 p (1 - p)), p the share of raw bits that are wrong.
    """
    p = raw_bit_errors(_POINTS[rate], sinr)
    code = _CODE[rate]
    d = math.sqrt(4.0 * p * (1.0 - p))
    step = d if _STEP[code] == 1 else d * d
    total = 0.0
    for i in range(9, -1, -1):
        total = total * step + _COEFFICIENTS[code, i]
    return min(total * d ** _FIRST[code], 1.0)


@njit(cache=True)
def ofdm_success(rate, sinr, bits):
    """The probability that so many bits of payload arrive right; 0.1 us."""
    return all_right(ofdm_bit_errors(rate, sinr), bits)
