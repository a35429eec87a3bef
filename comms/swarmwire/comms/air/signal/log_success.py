"""The logarithm of a bit's success by SINR, as a table: interference changes too often to work out a formula each time.

256 rows to an octave from 2^-10 to 2^12, found by the bits of the number, a straight line between two: the success of a
frame is right to 1e-3.
"""

# pyright: basic, reportUnknownMemberType=false

import math

import numpy as np
from numba import njit

from swarmwire.comms.air.reception.receiver import Model, Receiver, chunk_success
from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.borrowing import borrowing

LEAST_OCTAVE, MOST_OCTAVE, ROWS = -10, 12, 256
LEAST, MOST = 2.0**LEAST_OCTAVE, 2.0**MOST_OCTAVE
NEVER = -100.0  # of a bit that is never right
MANY = 1000.0  # bits, so that success close to 1 keeps its digits
THRESHOLD = int(Model.THRESHOLD)
_FRACTION_BITS = np.int64(44)  # 52 bits of a double's fraction, of which 8 choose the row
_FRACTION = np.int64(2**44 - 1)
_FIRST = np.int64((1023 + LEAST_OCTAVE) * ROWS)


def log_success_table(receiver: Receiver) -> FloatArray:
    """The table of a receiver; a threshold has none that would be of use."""
    octave = np.repeat(np.arange(LEAST_OCTAVE, MOST_OCTAVE), ROWS)
    sinr = np.append(2.0**octave * (1.0 + np.tile(np.arange(ROWS), MOST_OCTAVE - LEAST_OCTAVE) / ROWS), MOST)
    return _table(receiver, sinr)


@borrowing()
def log_success(table, receiver, sinr, bits):
    """The logarithm of the probability that so many bits are right at this SINR, a ratio."""
    if receiver.model == THRESHOLD:
        return 0.0 if chunk_success(receiver, sinr, bits) > 0.0 else bits * NEVER
    if sinr >= MOST:
        return 0.0
    at = np.float64(max(sinr, LEAST)).view(np.int64)
    row = (at >> _FRACTION_BITS) - _FIRST
    share = (at & _FRACTION) * (1.0 / (1 << 44))
    return bits * (table[row] + share * (table[row + 1] - table[row]))


@njit(cache=True)
def _table(receiver, sinr):
    out = np.empty(len(sinr))
    for i in range(len(out)):
        many, one = chunk_success(receiver, sinr[i], MANY), chunk_success(receiver, sinr[i], 1.0)
        if many > 0.1:
            out[i] = math.log(many) / MANY
        else:
            out[i] = max(math.log(one), NEVER) if one > 0.0 else NEVER
    return out
