"""IEEE 802.15.4 at 2.4 GHz: O-QPSK, four bits to one of sixteen spread symbols (250 kbit/s)."""

# pyright: basic, reportUnknownMemberType=false

import math

from numba import njit

from swarmwire.comms.air.reception.bits import all_right

# (-1)^k C(16, k) for k = 2 .. 16
_TERMS = tuple((-1.0) ** k * math.comb(16, k) for k in range(2, 17))


@njit(cache=True)
def oqpsk_bit_errors(sinr):
    """BER = 8/15 1/16 sum_{k=2..16} (-1)^k C(16, k) exp(20 SINR (1/k - 1)); 0.5 at SINR 0.

    IEEE 802.15.4-2006, E.4.1.7.
    """
    total = 0.0
    for i in range(15):
        total += _TERMS[i] * math.exp(20.0 * sinr * (1.0 / (i + 2) - 1.0))
    return min(max(total * 8.0 / 15.0 / 16.0, 0.0), 0.5)


@njit(cache=True)
def oqpsk_success(sinr, bits):
    """The probability that so many bits arrive right; a frame's are those of the whole PPDU, 8 x (PSDU + 6)."""
    return all_right(oqpsk_bit_errors(sinr), bits)
