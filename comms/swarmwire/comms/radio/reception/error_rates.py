"""Error rates of modulations: from SINR to the probability that a number of bits is received without error.

Bit errors are independent and equally likely. IEEE 802.15.4 (O-QPSK), 802.11b (DSSS, CCK), 802.11a/g/n (OFDM), Gazebo's
RFComms, measured tables and thresholds.
"""

import math
from typing import Any

import numpy as np

from swarmwire.comms.base.arrays import AnyArray
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.base.math import compiled as math_compiled
from swarmwire.comms.radio.propagation.decibels import to_db
from swarmwire.comms.radio.timing import HT_BITS_PER_SYMBOL, OFDM_BITS_PER_SYMBOL


@njit()
def all_right(error_rate: float, bits: Any):
    """Return (1 - error_rate)^bits with the digits of small rates; 1 for 0 bits. `bits` may be a fraction."""
    if bits <= 0.0 or error_rate <= 0.0:
        return 1.0
    if error_rate >= 1.0:
        return 0.0
    return math_compiled.exp(bits * math_compiled.log1p(-error_rate))


# IEEE 802.15.4 at 2.4 GHz: O-QPSK, one of sixteen spread symbols per four bits (250 kbit/s).


# (-1)^k C(16, k) for k = 2 .. 16
_TERMS = tuple((-1.0) ** k * math.comb(16, k) for k in range(2, 17))


@njit()
def oqpsk_bit_errors(sinr: Any):
    """Return the BER 8/15 1/16 sum_{k=2..16} (-1)^k C(16, k) exp(20 SINR (1/k - 1)); 0.5 at SINR 0.

    Source: IEEE 802.15.4-2006, E.4.1.7.
    """
    total = 0.0
    for i in range(15):
        total += _TERMS[i] * math_compiled.exp(20.0 * sinr * (1.0 / (i + 2) - 1.0))
    return min(max(total * 8.0 / 15.0 / 16.0, 0.0), 0.5)


@njit()
def oqpsk_success(sinr: Any, bits: Any):
    """Return the probability of `bits` bits without error; a frame counts its PPDU, 8 x (PSDU + 6) bits."""
    return all_right(oqpsk_bit_errors(sinr), bits)


# IEEE 802.11b: direct sequence at 1 and 2 Mbit/s, complementary codes (CCK) at 5.5 and 11, in 22 MHz.
#
# Formulas as in ns-3 (G. Pei and T. R. Henderson, Validation of ns-3 802.11b PHY model, 2009). A CCK symbol is four
# (5.5) or eight (11 Mbit/s) bits, chosen among biorthogonal codes (J. G. Proakis, Digital Communications, 4th ed.,
# 5.2).


DBPSK_1, DQPSK_2, CCK_5_5, CCK_11 = range(4)
SQRT2 = math.sqrt(2.0)
# The CCK integrand is a bell of variance 1/2 or less: 48 nodes over 6 to either side are exact to 1e-12 of its peak.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(48)
HALF_WIDTH = 6.0


@njit()
def dbpsk_bit_errors(sinr: Any):
    """Return the BER at 1 Mbit/s: 1/2 exp(-Eb/N0), Eb/N0 = SINR 22 MHz / 1 Mbit/s."""
    return 0.5 * math_compiled.exp(-22.0 * sinr)


@njit()
def dqpsk_bit_errors(sinr: Any):
    """Return the BER at 2 Mbit/s: (sqrt 2 + 1) / sqrt(8 pi sqrt 2 x) exp(-(2 - sqrt 2) x) up to 1/2, x = 11 SINR."""
    x = 11.0 * sinr
    if x <= 0.0:
        return 0.5
    return min((SQRT2 + 1.0) / math.sqrt(8.0 * math.pi * SQRT2 * x) * math_compiled.exp(-(2.0 - SQRT2) * x), 0.5)


@njit()
def biorthogonal_errors(signal: Any):
    """Return the error rate of 16 biorthogonal codes; `signal` is the correct code's correlation in units of noise.

    1 - integral_0^inf erf(y / sqrt 2)^7 phi(y - signal) dy, phi the standard normal density: computed as the
    complement, for the digits of small rates.
    """
    low = max(0.5 * signal - HALF_WIDTH, 0.0)
    high = 0.5 * signal + HALF_WIDTH
    missing = 0.0
    for i in range(len(_NODES)):
        y = low + 0.5 * (high - low) * (_NODES[i] + 1.0)
        not_all_lower = -math_compiled.expm1(7.0 * math_compiled.log1p(-math_compiled.erfc(y / SQRT2)))
        missing += _WEIGHTS[i] * not_all_lower * math_compiled.exp(-0.5 * (y - signal) ** 2)
    missing *= 0.5 * (high - low) / math.sqrt(2.0 * math.pi)
    return min(missing + 0.5 * math_compiled.erfc(signal / SQRT2), 1.0)


@njit()
def dsss_success(rate: int, sinr: float, bits: Any):
    """Return the probability of `bits` bits without error at DSSS_RATES_BPS[rate]; 1.5 us for CCK, else 0.1 us.

    At 5.5 Mbit/s four bits are one choice, at 11 eight bits are two choices of half the signal: a choice per four bits.
    """
    if rate == DBPSK_1:
        return all_right(dbpsk_bit_errors(sinr), bits)
    if rate == DQPSK_2:
        return all_right(dqpsk_bit_errors(sinr), bits)
    signal = math.sqrt((16.0 if rate == CCK_5_5 else 8.0) * sinr)
    return all_right(biorthogonal_errors(signal), 0.25 * bits)


# IEEE 802.11a/g/n: OFDM at 6 to 65 Mbit/s in 20 MHz, with the convolutional code K = 7, generators 133 and 171.
#
# Soft decisions: the union bound over the code's paths that leave the correct path, with the probabilities of
# bit-interleaved coded modulation. Hard decisions, the NIST model, which is ns-3's default up to 3.32 (G. Pei and T. R.
# Henderson, Validation of OFDM error rate model in ns-3, 2010): errors of the raw bits by modulation, then Chernoff's
# bound over the weights of the bits of those paths.


OFDM_RATES_BPS = tuple(OFDM_BITS_PER_SYMBOL)
# Points of the constellation and index in SPECTRA, for each rate, and for MCS 7.
_POINTS = (2, 2, 4, 4, 16, 16, 64, 64, 64)
_CODE = (0, 2, 0, 2, 0, 2, 1, 2, 3)
# An MCS has modulation and code of a rate of 802.11a, except for MCS 7 (802.11n-2009: 20.6).
MODULATIONS = {rate_bps: index for index, rate_bps in enumerate(OFDM_RATES_BPS)} | dict(
    zip(HT_BITS_PER_SYMBOL, (0, 2, 3, 4, 5, 6, 7, 8), strict=True)
)
# Rates 1/2, 2/3, 3/4 and 5/6: first exponent of D, its step, the factor before the sum, and the coefficients.
SPECTRA = (
    (10, 2, 1 / 2, (36, 211, 1404, 11633, 77433, 502690, 3322763, 21292910, 134365911)),
    (6, 1, 1 / 4, (3, 70, 285, 1276, 6160, 27128, 117019, 498860, 2103891, 8784123)),
    (5, 1, 1 / 6, (42, 201, 1492, 10469, 62935, 379644, 2253373, 13073811, 75152755, 428005675)),
    (4, 1, 1 / 10, (92, 528, 8694, 79453, 792114, 7375573, 67884974, 610875423, 5427275376, 47664215639)),
)
_FIRST = tuple(spectrum[0] for spectrum in SPECTRA)
_STEP = tuple(spectrum[1] for spectrum in SPECTRA)
_COEFFICIENTS = np.zeros((4, 10))
for _code, (_, _, _factor, _weights) in enumerate(SPECTRA):
    _COEFFICIENTS[_code, : len(_weights)] = np.multiply(_factor, _weights)
# Bits in a period, and paths by weight from the first exponent on: D. Haccoun and G. Begin, IEEE Trans. Comm. 37, 1989.
PATHS = (
    (1, (11, 38, 193, 1331, 7275, 40406, 234969, 1337714)),
    (2, (1, 16, 48, 158, 642, 2435, 9174, 34701, 131533, 499312)),
    (3, (8, 31, 160, 892, 4512, 23297, 120976, 624304, 3229885, 16721329)),
    (5, (14, 69, 654, 4996, 39677, 314973, 2503576, 19875546, 157824160, 1253169928)),
)
_PATHS = np.zeros((4, 10))
for _code, (_bits, _paths) in enumerate(PATHS):
    _PATHS[_code, : len(_paths)] = np.divide(_paths, _bits)


@njit()
def raw_bit_errors(points: Any, sinr: Any):
    """Return the bit error rate before decoding for a constellation's number of points; s = SINR in 20 MHz.

    BPSK 1/2 erfc(sqrt s), QPSK 1/2 erfc(sqrt(s / 2)), M-QAM with L = sqrt M
    (L - 1) / (L log2 L) erfc(sqrt(3 s / (2 (M - 1)))).
    """
    if points == 2:
        return 0.5 * math_compiled.erfc(math.sqrt(sinr))
    if points == 4:
        return 0.5 * math_compiled.erfc(math.sqrt(0.5 * sinr))
    side = math.sqrt(points)
    return (side - 1.0) / (side * math_compiled.log2(side)) * math_compiled.erfc(math.sqrt(1.5 * sinr / (points - 1.0)))


@njit()
def bit_affinity(points: Any, sinr: Any):
    """Return the Bhattacharyya coefficient of a bit of a Gray-mapped constellation, s = SINR in 20 MHz; at most 1.

    BPSK exp(-s), QPSK exp(-s / 2), M-QAM with L = sqrt M: each of the (L - 1) boundaries between neighbours whose bits
    differ adds 2 / (L log2 L) exp(-3 s / (2 (M - 1))); points farther apart are neglected.
    """
    if points == 2:
        return math_compiled.exp(-sinr)
    side = math.sqrt(points)
    return 2.0 * (side - 1.0) / (side * math_compiled.log2(side)) * math_compiled.exp(-1.5 * sinr / (points - 1.0))


@njit()
def ofdm_path_errors(rate: int, sinr: float):
    """Return an upper bound of the decoder's probability per bit to leave the correct path; `rate` of MODULATIONS.

    1 / k sum a_d Q(sqrt(-2 d ln B)): a_d paths of weight d, k bits in a period of the punctured code, B the
    `bit_affinity` (A. Martinez, A. Guillen i Fabregas, G. Caire, IEEE Trans. Inf. Theory 52, 2006); at most 1.
    """
    code, exponent = _CODE[rate], -math_compiled.log(max(bit_affinity(_POINTS[rate], sinr), 1e-300))
    weight, total = _FIRST[code], 0.0
    for i in range(10):
        total += _PATHS[code, i] * 0.5 * math_compiled.erfc(math.sqrt(weight * exponent))
        weight += _STEP[code]
    return min(total, 1.0)


@njit()
def ofdm_success(rate: int, sinr: float, bits: Any):
    """Return the probability of `bits` bits of payload without error, by soft decisions; 0.3 us."""
    return all_right(ofdm_path_errors(rate, sinr), bits)


@njit()
def nist_bit_errors(rate: int, sinr: float):
    """Return an upper bound of the bit error rate after decoding; `rate` of MODULATIONS; at most 1.

    The sum of coefficient x D^exponent, with D = sqrt(4 p (1 - p)) and p the bit error rate before decoding.
    """
    p = raw_bit_errors(_POINTS[rate], sinr)
    code = _CODE[rate]
    d = math.sqrt(4.0 * p * (1.0 - p))
    step = d if _STEP[code] == 1 else d * d
    total = 0.0
    for i in range(9, -1, -1):
        total = total * step + _COEFFICIENTS[code, i]
    return min(total * d ** _FIRST[code], 1.0)


@njit()
def nist_success(rate: int, sinr: float, bits: Any):
    """Return the probability of `bits` bits of payload without error, by hard decisions; 0.1 us."""
    return all_right(nist_bit_errors(rate, sinr), bits)


@njit()
def gazebo_success(sinr: Any, bits: Any):
    """Return success as gz-sim and SubT compute it: erfc(sqrt(SINR)) is the loss of a byte, not of a bit."""
    return all_right(math_compiled.erfc(math.sqrt(sinr)), bits / 8.0)


@njit()
def table_success(sinr_db: AnyArray, success: AnyArray, frame_bits: Any, sinr: Any, bits: Any):
    """Return the probability of `bits` bits without error: success^(bits / frame_bits), so that chunks multiply.

    `sinr_db` and `success` (rows,) are the table's, `sinr` a ratio.
    """
    at_db = to_db(sinr)
    last = len(sinr_db) - 1
    if at_db <= sinr_db[0]:
        frame_success = success[0]
    elif at_db >= sinr_db[last]:
        frame_success = success[last]
    else:
        i = 0
        while sinr_db[i + 1] < at_db:
            i += 1
        share = (at_db - sinr_db[i]) / (sinr_db[i + 1] - sinr_db[i])
        frame_success = success[i] + share * (success[i + 1] - success[i])
    return 1.0 if bits <= 0.0 else math_compiled.power(frame_success, bits / frame_bits)


@njit()
def threshold_success(min_sinr: Any, sinr: Any):
    """Return 1 if SINR, a ratio, reaches `min_sinr`, else 0, for any number of bits."""
    return 1.0 if sinr >= min_sinr else 0.0
