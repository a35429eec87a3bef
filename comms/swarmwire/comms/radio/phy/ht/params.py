"""Parameters of the frame exchanges of 802.11n, and the airtime of their frames."""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.radio.config.frames import dcf_of, signal_extension_ns
from swarmwire.comms.radio.config.phy import RATE_CONTROLS
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.propagation.decibels import from_db
from swarmwire.comms.radio.reception.receiver import receiver_of, sinr_for_db
from swarmwire.comms.radio.timing import HT_BITS_PER_SYMBOL, OFDM_BITS_PER_SYMBOL, OFDM_MANDATORY_BPS, US

MCS = len(HT_BITS_PER_SYMBOL)
HT_RATES_BPS = (*HT_BITS_PER_SYMBOL, *OFDM_MANDATORY_BPS)  # rows of `PhyParams.log_success`
BASIC_RATE = MCS  # 6 Mbit/s
FIXED, IDEAL, AARF = range(len(RATE_CONTROLS))
HT_PREAMBLE_NS, OFDM_PREAMBLE_NS, SYMBOL_NS = 36 * US, 20 * US, 4 * US
ACK_BYTES, BLOCK_ACK_BYTES, REQUEST_BYTES, RTS_BYTES, CTS_BYTES = 14, 32, 24, 20, 14
DELIMITER_BYTES = 4  # of an MPDU in an A-MPDU; each but the last is padded to a multiple of it
MAX_MPDUS = 64  # window of a block acknowledgement
REQUEST_ATTEMPTS = 7  # at a request that only moves the receiver's window, without max_retries: dot11ShortRetryLimit
MAX_PPDU_NS = 5_484 * US  # aPPDUMaxTime
MAX_AMPDU_BYTES = 65_535
NEVER_BYTES = 2**31
NO_LIMIT = 2**31
IDEAL_BIT_SUCCESS = 1.0 - 1e-6


class HtParams(NamedTuple):
    """802.11n as numbers for kernels."""

    preamble_ns: IntArray  # by bit rate, a row in `PhyParams.log_success`
    symbol_bits: IntArray  # by bit rate
    control_rate: IntArray  # bit rate of responses, by MCS
    extension_ns: int  # signal extension
    wait_ns: int  # time after a frame in which its response begins
    nav_reset_ns: int  # time after an RTS in which the announced frame begins
    max_ampdu_bytes: int  # 0: no aggregation
    rts_threshold_bytes: int
    max_attempts: int
    rate_control: int  # FIXED, IDEAL or AARF
    max_rate: int  # MCS
    min_sinr: FloatArray  # by MCS: least SINR for IDEAL, a ratio


def ht_params_of(radio: Radio) -> HtParams:
    """Return the parameters of a radio of 802.11n."""
    access, dcf, extension_ns = radio.access_or_default, dcf_of(radio), signal_extension_ns(radio)
    symbol_bits = [*HT_BITS_PER_SYMBOL.values(), *(OFDM_BITS_PER_SYMBOL[rate_bps] for rate_bps in OFDM_MANDATORY_BPS)]
    control = [max(rate for rate in OFDM_MANDATORY_BPS if rate <= mcs_bps) for mcs_bps in HT_BITS_PER_SYMBOL]
    cts_ns = OFDM_PREAMBLE_NS - (-(22 + 8 * CTS_BYTES) // symbol_bits[BASIC_RATE]) * SYMBOL_NS + extension_ns
    max_ampdu_bytes = MAX_AMPDU_BYTES if access.aggregation_bytes is None else access.aggregation_bytes
    attempts = 1 + (dcf.max_retries if access.max_retries is None else access.max_retries)
    if access.max_retries is None and radio.queue_lifetime_s is not None and max_ampdu_bytes > 0:
        attempts = NO_LIMIT
    receivers = (receiver_of(radio.reception_or_default, rate_bps) for rate_bps in HT_BITS_PER_SYMBOL)
    return HtParams(
        preamble_ns=np.array([HT_PREAMBLE_NS] * MCS + [OFDM_PREAMBLE_NS] * len(OFDM_MANDATORY_BPS)),
        symbol_bits=np.array(symbol_bits),
        control_rate=np.array([HT_RATES_BPS.index(rate_bps) for rate_bps in control]),
        extension_ns=extension_ns,
        wait_ns=dcf.sifs_ns + dcf.slot_ns + OFDM_PREAMBLE_NS,
        nav_reset_ns=2 * dcf.sifs_ns + cts_ns + OFDM_PREAMBLE_NS + 2 * dcf.slot_ns,
        max_ampdu_bytes=max_ampdu_bytes,
        rts_threshold_bytes=NEVER_BYTES if access.rts_threshold_bytes is None else access.rts_threshold_bytes,
        max_attempts=attempts,
        rate_control=RATE_CONTROLS.index(access.rate_control),
        max_rate=HT_RATES_BPS.index(radio.bit_rate_bps),
        min_sinr=np.array([from_db(sinr_for_db(receiver, IDEAL_BIT_SUCCESS, 1)) for receiver in receivers]),
    )


@kernel()
def frame_ns(ht, rate, octets):
    """Return the airtime of a PSDU of `octets` octets at a bit rate, `ht` being `HtParams`."""
    return ht.preamble_ns[rate] - (-(22 + 8 * octets) // ht.symbol_bits[rate]) * SYMBOL_NS + ht.extension_ns
