"""Reception: the probability that a chunk of a frame is right, by the model that the radio has.

A frame is cut where its interference changes: its success is the product over its chunks of constant SINR.
"""

# pyright: basic, reportUnknownMemberType=false

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numba import njit

from swarmwire.comms.air.decibels import from_db
from swarmwire.comms.air.parameters.reception import Reception, SuccessTable
from swarmwire.comms.air.reception import dsss, ofdm
from swarmwire.comms.air.reception.dsss import dsss_success
from swarmwire.comms.air.reception.ofdm import ofdm_success
from swarmwire.comms.air.reception.oqpsk import oqpsk_success
from swarmwire.comms.air.reception.success_table import table_success
from swarmwire.comms.air.reception.threshold import threshold_success
from swarmwire.comms.arrays import FloatArray


class Model(IntEnum):
    """What turns SINR into success."""

    THRESHOLD = 0  # a fixed SINR
    TABLE = 1  # measured
    OQPSK = 2  # IEEE 802.15.4, 2.4 GHz
    DSSS = 3  # IEEE 802.11b
    OFDM = 4  # IEEE 802.11a/g


class Receiver(NamedTuple):
    """A model with its numbers, as kernels take it; made by one of the functions below."""

    model: int
    rate: int  # index among the rates of DSSS or OFDM
    least_sinr: float  # of THRESHOLD, a ratio
    frame_bits: float  # of TABLE
    sinr_db: FloatArray  # of TABLE, (rows,)
    success: FloatArray  # of TABLE, (rows,)


_NO_ROWS = np.empty(0)
_THRESHOLD, _TABLE, _OQPSK, _DSSS = int(Model.THRESHOLD), int(Model.TABLE), int(Model.OQPSK), int(Model.DSSS)


def by_threshold(least_sinr_db: float) -> Receiver:
    """A frame is right if its SINR never falls below this."""
    return Receiver(_THRESHOLD, 0, from_db(least_sinr_db), 0.0, _NO_ROWS, _NO_ROWS)


def by_table(table: SuccessTable) -> Receiver:
    """A measured receiver."""
    rows = np.array(table.sinr_db, np.float64), np.array(table.success, np.float64)
    return Receiver(_TABLE, 0, 0.0, float(table.frame_bits), *rows)


def ieee802154() -> Receiver:
    """A receiver of IEEE 802.15.4 at 2.4 GHz."""
    return Receiver(_OQPSK, 0, 0.0, 0.0, _NO_ROWS, _NO_ROWS)


def ieee80211b(rate_bps: int) -> Receiver:
    """A receiver of IEEE 802.11b at one of `dsss.RATES_BPS`; ValueError at any other."""
    return Receiver(_DSSS, dsss.RATES_BPS.index(rate_bps), 0.0, 0.0, _NO_ROWS, _NO_ROWS)


def ieee80211ag(rate_bps: int) -> Receiver:
    """A receiver of IEEE 802.11a or g at one of `ofdm.RATES_BPS`; ValueError at any other."""
    return Receiver(int(Model.OFDM), ofdm.RATES_BPS.index(rate_bps), 0.0, 0.0, _NO_ROWS, _NO_ROWS)


def receiver_of(reception: Reception, bit_rate_bps: int) -> Receiver:
    """The receiver that a scenario asks for, which `refuse_unfit` has let pass."""
    if reception.model == "threshold":
        return by_threshold(reception.least_sinr_db)
    if reception.table is not None and reception.model == "table":
        return by_table(reception.table)
    if reception.model == "802.11b":
        return ieee80211b(bit_rate_bps)
    return ieee80211ag(bit_rate_bps) if reception.model == "802.11ag" else ieee802154()


@njit(cache=True)
def chunk_success(receiver, sinr, bits):
    """The probability that so many bits (may be a fraction) arrive right at a constant SINR, a ratio of powers."""
    if receiver.model == _THRESHOLD:
        return threshold_success(receiver.least_sinr, sinr)
    if receiver.model == _TABLE:
        return table_success(receiver.sinr_db, receiver.success, receiver.frame_bits, sinr, bits)
    if receiver.model == _OQPSK:
        return oqpsk_success(sinr, bits)
    if receiver.model == _DSSS:
        return dsss_success(receiver.rate, sinr, bits)
    return ofdm_success(receiver.rate, sinr, bits)
