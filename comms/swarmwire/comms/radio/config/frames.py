"""The frames of a radio: airtime, and size and bit rate of acknowledgements.

No kernels: a scenario is read without a compiler.
"""

from dataclasses import replace

import numpy as np

from swarmwire.comms.base.arrays import IntArray
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.timing import (
    DSSS_RATES_BPS,
    OFDM_MANDATORY_BPS,
    at_bit_rate_ns,
    ieee80211a_ns,
    ieee80211b_ns,
    ieee80211g_ns,
)

ACK_802154_BYTES = 11  # preamble, delimiter, length and PSDU
ACK_80211_BYTES = 14  # PSDU


def airtime_ns(radio: Radio, frame_bytes: IntArray) -> IntArray:
    """Airtime of frames of these sizes, overhead included, in ns, (k,)."""
    if radio.frame == "802.11b":
        return ieee80211b_ns(frame_bytes, radio.bit_rate_bps, short_preamble=False)
    if radio.frame == "802.11a":
        return ieee80211a_ns(frame_bytes, radio.bit_rate_bps)
    if radio.frame == "802.11g":
        return ieee80211g_ns(frame_bytes, radio.bit_rate_bps)
    return at_bit_rate_ns(frame_bytes, radio.bit_rate_bps)


def acknowledgement_bytes(radio: Radio) -> int:
    """Size of an acknowledgement."""
    return ACK_802154_BYTES if radio.frame == "plain" else ACK_80211_BYTES


def acknowledgement_rate_bps(radio: Radio) -> int:
    """Bit rate of acknowledgements: OFDM's highest mandatory rate up to that of the frame (802.11-2007, 9.6)."""
    if radio.frame in ("802.11a", "802.11g"):
        return max(rate_bps for rate_bps in OFDM_MANDATORY_BPS if rate_bps <= radio.bit_rate_bps)
    return radio.bit_rate_bps


def acknowledgement_ns(radio: Radio) -> int:
    """Airtime of an acknowledgement, in ns."""
    radio = replace(radio, bit_rate_bps=acknowledgement_rate_bps(radio))
    return int(airtime_ns(radio, np.array([acknowledgement_bytes(radio)]))[0])


def eifs_acknowledgement_ns(radio: Radio) -> int:
    """Airtime of the acknowledgement in EIFS, in ns: at the lowest mandatory bit rate, 802.11b's also for 802.11g."""
    if radio.frame == "802.11a":
        return int(ieee80211a_ns(ACK_80211_BYTES, OFDM_MANDATORY_BPS[0]))
    return int(ieee80211b_ns(ACK_80211_BYTES, DSSS_RATES_BPS[0], short_preamble=False))
