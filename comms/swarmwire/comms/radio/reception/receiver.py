"""Receivers: the success probability of a chunk of a frame by error model, and the sensitivity.

A frame is cut into chunks of constant SINR. Its success is the product over its chunks.
"""

from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.radio.config.phy import Reception, SuccessTable
from swarmwire.comms.radio.propagation.decibels import from_db
from swarmwire.comms.radio.reception.error_rates import (
    MODULATIONS,
    dsss_success,
    gazebo_success,
    nist_success,
    ofdm_success,
    oqpsk_success,
    table_success,
    threshold_success,
)
from swarmwire.comms.radio.timing import DSSS_RATES_BPS


class Model(IntEnum):
    """Error models, from SINR to success probability."""

    THRESHOLD = 0  # a fixed SINR
    TABLE = 1  # measured
    OQPSK = 2  # IEEE 802.15.4, 2.4 GHz
    DSSS = 3  # IEEE 802.11b
    OFDM = 4  # IEEE 802.11a/g/n, soft decisions
    NIST = 5  # IEEE 802.11a/g/n, hard decisions
    GAZEBO = 6  # gz-sim's RFComms


class Receiver(NamedTuple):
    """An error model with its parameters, an input of kernels; the functions below create it."""

    model: int
    rate: int  # index among the rates of DSSS, or in MODULATIONS
    min_sinr: float  # THRESHOLD only; a ratio
    frame_bits: float  # TABLE only
    sinr_db: FloatArray  # TABLE only; (rows,)
    success: FloatArray  # TABLE only; (rows,)


_NO_ROWS = np.empty(0)
_THRESHOLD, _TABLE, _OQPSK, _DSSS, _OFDM, _NIST, _GAZEBO = map(int, Model)
OFDM_MODELS = {"802.11ag": Model.OFDM, "802.11ag-nist": Model.NIST}
MIN_DB, MAX_DB = -60.0, 100.0  # bounds of `sinr_for_db`
HALVINGS = 60


def by_threshold(min_sinr_db: float) -> Receiver:
    """Return a receiver that decodes a frame if its SINR never falls below this."""
    return Receiver(_THRESHOLD, 0, from_db(min_sinr_db), 0.0, _NO_ROWS, _NO_ROWS)


def by_table(table: SuccessTable) -> Receiver:
    """Return a receiver with measured success."""
    rows = np.array(table.sinr_db, np.float64), np.array(table.success, np.float64)
    return Receiver(_TABLE, 0, 0.0, float(table.frame_bits), *rows)


def ieee802154() -> Receiver:
    """Return a receiver of IEEE 802.15.4 at 2.4 GHz."""
    return Receiver(_OQPSK, 0, 0.0, 0.0, _NO_ROWS, _NO_ROWS)


def ieee80211b(rate_bps: int) -> Receiver:
    """Return a receiver of IEEE 802.11b at one of DSSS_RATES_BPS; ValueError at any other rate."""
    return Receiver(_DSSS, DSSS_RATES_BPS.index(rate_bps), 0.0, 0.0, _NO_ROWS, _NO_ROWS)


def ieee80211ag(rate_bps: int, model: Model = Model.OFDM) -> Receiver:
    """Return a receiver of IEEE 802.11a/g/n at a rate of MODULATIONS, with OFDM or NIST; KeyError at other rates."""
    return Receiver(int(model), MODULATIONS[rate_bps], 0.0, 0.0, _NO_ROWS, _NO_ROWS)


def gazebo() -> Receiver:
    """Return a receiver of gz-sim's RFComms."""
    return Receiver(_GAZEBO, 0, 0.0, 0.0, _NO_ROWS, _NO_ROWS)


def receiver_of(reception: Reception, bit_rate_bps: int) -> Receiver:
    """Return the receiver of a scenario's `Reception`, which `refuse_unfit` has checked."""
    if reception.model == "threshold":
        return by_threshold(reception.min_sinr_db)
    if reception.table is not None and reception.model == "table":
        return by_table(reception.table)
    if reception.model == "802.11b":
        return ieee80211b(bit_rate_bps)
    if reception.model in OFDM_MODELS:
        return ieee80211ag(bit_rate_bps, OFDM_MODELS[reception.model])
    return gazebo() if reception.model == "gazebo" else ieee802154()


@njit()
def chunk_success(receiver: Any, sinr: Any, bits: Any):
    """Return the probability of `bits` bits (may be a fraction) without error at a constant SINR, a ratio of powers."""
    if receiver.model == _THRESHOLD:
        return threshold_success(receiver.min_sinr, sinr)
    if receiver.model == _TABLE:
        return table_success(receiver.sinr_db, receiver.success, receiver.frame_bits, sinr, bits)
    if receiver.model == _OQPSK:
        return oqpsk_success(sinr, bits)
    if receiver.model == _DSSS:
        return dsss_success(receiver.rate, sinr, bits)
    if receiver.model == _GAZEBO:
        return gazebo_success(sinr, bits)
    if receiver.model == _NIST:
        return nist_success(receiver.rate, sinr, bits)
    return ofdm_success(receiver.rate, sinr, bits)


def sinr_for_db(receiver: Receiver, success: float, bits: int) -> float:
    """Return the SINR in dB at which a frame of `bits` bits is received with probability `success`; by bisection.

    `MIN_DB` if every SINR suffices, `MAX_DB` if none does.
    """
    low, high = MIN_DB, MAX_DB
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if chunk_success(receiver, from_db(middle), float(bits)) >= success:
            high = middle
        else:
            low = middle
    return high


def sensitivity_dbm(receiver: Receiver, noise_dbm: float, success: float, bits: int) -> float:
    """Return the power in dBm at which a frame of `bits` bits is received with probability `success`, alone on air.

    Data sheets of IEEE 802.15.4 state it for 99 % of frames with a PSDU of 20 octets; 802.11b: 92 % of 1024 octets;
    802.11a/g: 90 % of 1000.
    """
    return noise_dbm + sinr_for_db(receiver, success, bits)
