"""IEEE 802.11b: direct sequence at 1 and 2 Mbit/s, complementary codes (CCK) at 5.5 and 11, in 22 MHz.

Formulas as in ns-3 (G. Pei and T. R. Henderson, Validation of ns-3 802.11b PHY model, 2009). A CCK symbol is four (5.5)
or eight (11 Mbit/s) bits, chosen among biorthogonal codes (J. G. Proakis, Digital Communications, 4th ed., 5.2).
"""

# pyright: basic, reportUnknownMemberType=false

import math

import numpy as np
from numba import njit

from swarmwire.comms.air.reception.bits import all_right
from swarmwire.comms.air.timing.airtime import DSSS_RATES_BPS

DBPSK_1, DQPSK_2, CCK_5_5, CCK_11 = range(4)
RATES_BPS = DSSS_RATES_BPS
SQRT2 = math.sqrt(2.0)
# The integrand of CCK is a bell of variance 1/2 or less: 48 nodes over 6 to either side give 1e-12 of the greatest.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(48)
HALF_WIDTH = 6.0


@njit(cache=True)
def dbpsk_bit_errors(sinr):
    """1 Mbit/s: BER = 1/2 exp(-Eb/N0), Eb/N0 = SINR 22 MHz / 1 Mbit/s."""
    return 0.5 * math.exp(-22.0 * sinr)


@njit(cache=True)
def dqpsk_bit_errors(sinr):
    """2 Mbit/s: BER = (sqrt 2 + 1) / sqrt(8 pi sqrt 2 x) exp(-(2 - sqrt 2) x), x = Eb/N0 = 11 SINR; at most 1/2."""
    x = 11.0 * sinr
    if x <= 0.0:
        return 0.5
    return min((SQRT2 + 1.0) / math.sqrt(8.0 * math.pi * SQRT2 * x) * math.exp(-(2.0 - SQRT2) * x), 0.5)


@njit(cache=True)
def biorthogonal_errors(signal):
    """How often one of 16 biorthogonal codes is mistaken; `signal` is the right one's correlation in units of noise.

    1 - integral_0^inf erf(y / sqrt 2)^7 phi(y - signal) dy, phi the standard normal density: computed as what is
    missing, so that small rates keep their digits.
    """
    low = max(0.5 * signal - HALF_WIDTH, 0.0)
    high = 0.5 * signal + HALF_WIDTH
    missing = 0.0
    for i in range(len(_NODES)):
        y = low + 0.5 * (high - low) * (_NODES[i] + 1.0)
        not_all_lower = -math.expm1(7.0 * math.log1p(-math.erfc(y / SQRT2)))
        missing += _WEIGHTS[i] * not_all_lower * math.exp(-0.5 * (y - signal) ** 2)
    missing *= 0.5 * (high - low) / math.sqrt(2.0 * math.pi)
    return min(missing + 0.5 * math.erfc(signal / SQRT2), 1.0)


@njit(cache=True)
def dsss_success(rate, sinr, bits):
    """The probability that so many bits arrive right at one of RATES_BPS, by index; 1.5 us for CCK, else 0.1 us.

    At 5.5 Mbit/s four bits are one choice, at 11 eight are two of half the signal: so both count quarters of the bits.
    """
    if rate == DBPSK_1:
        return all_right(dbpsk_bit_errors(sinr), bits)
    if rate == DQPSK_2:
        return all_right(dqpsk_bit_errors(sinr), bits)
    signal = math.sqrt((16.0 if rate == CCK_5_5 else 8.0) * sinr)
    return all_right(biorthogonal_errors(signal), 0.25 * bits)
