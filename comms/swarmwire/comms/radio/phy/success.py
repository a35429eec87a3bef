"""Success of bits by SINR: tables of its logarithm, and the success of frames without interference."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.kernels import kernel, njit
from swarmwire.comms.base.math import compiled as math_compiled
from swarmwire.comms.radio.propagation.decibels import from_db
from swarmwire.comms.radio.reception.receiver import Model, Receiver, chunk_success

MIN_OCTAVE, MAX_OCTAVE, ROWS = -10, 12, 256
MIN_SINR, MAX_SINR = 2.0**MIN_OCTAVE, 2.0**MAX_OCTAVE
LOG_NEVER = -100.0  # log success of a bit that is always wrong
CHUNK_BITS = 1000.0  # length at which the table evaluates success, for the digits of success close to 1
THRESHOLD = int(Model.THRESHOLD)
_FRACTION_BITS = np.int64(44)  # a double's fraction has 52 bits, of which the first 8 select the row
_FRACTION = np.int64(2**44 - 1)
_FIRST = np.int64((1023 + MIN_OCTAVE) * ROWS)


def log_success_table(receiver: Receiver) -> FloatArray:
    """Return the logarithm of a bit's success by SINR, (rows,), which the threshold model does not use.

    Interference changes too often to evaluate a formula each time. The table has 256 rows per octave from 2^-10 to
    2^12. The bits of the SINR select the row; with linear interpolation a frame's success is accurate to 1e-3.
    """
    octave = np.repeat(np.arange(MIN_OCTAVE, MAX_OCTAVE), ROWS)
    sinr = np.append(2.0**octave * (1.0 + np.tile(np.arange(ROWS), MAX_OCTAVE - MIN_OCTAVE) / ROWS), MAX_SINR)
    return _table(receiver, sinr)


@kernel(inline="always")
def log_success(params, rate, sinr, bits):
    """Return the logarithm of the probability of `bits` bits at this rate without error at this SINR, a ratio."""
    table, receiver = params.log_success, params.receiver
    if receiver.model == THRESHOLD:
        return 0.0 if chunk_success(receiver, sinr, bits) > 0.0 else bits * LOG_NEVER
    if sinr >= MAX_SINR:
        return 0.0
    sinr_bits = np.float64(max(sinr, MIN_SINR)).view(np.int64)
    row = (sinr_bits >> _FRACTION_BITS) - _FIRST
    share = (sinr_bits & _FRACTION) * (1.0 / (1 << 44))
    return bits * (table[rate, row] + share * (table[rate, row + 1] - table[rate, row]))


@njit()
def _table(receiver, sinr):
    out = np.empty(len(sinr))
    for i in range(len(out)):
        chunk, bit = chunk_success(receiver, sinr[i], CHUNK_BITS), chunk_success(receiver, sinr[i], 1.0)
        if chunk > 0.1:
            out[i] = math_compiled.log(chunk) / CHUNK_BITS
        else:
            out[i] = max(math_compiled.log(bit), LOG_NEVER) if bit > 0.0 else LOG_NEVER
    return out


@kernel()
def alone_log_success(params, power_mw, bits, rate):
    """Return the logarithm of a frame's success probability without interference."""
    if power_mw < params.min_preamble_mw or power_mw < params.min_preamble_sinr * params.noise_mw:
        return bits * LOG_NEVER
    if power_mw >= params.error_free_sinr * params.noise_mw:
        return 0.0
    return log_success(params, rate, power_mw / params.noise_mw, bits)


@kernel(from_python=True)
def lone_delivery(params, mean_dbm, bits):
    """Return the success probability of a lone frame of `bits` bits at this power."""
    return math_compiled.exp(alone_log_success(params, from_db(mean_dbm), bits, params.data_rate))


@njit()
def lone_deliveries(params, mean_dbm, bits):
    """Return `lone_delivery` at several powers, (k,)."""
    delivery = np.empty(len(mean_dbm))
    for i in range(len(delivery)):
        delivery[i] = lone_delivery(params, mean_dbm[i], bits)
    return delivery
