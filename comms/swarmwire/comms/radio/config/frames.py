"""The frames of a radio: airtime, and size and bit rate of acknowledgements.

No kernels: a scenario is read without a compiler.
"""

from dataclasses import replace

import numpy as np

from swarmwire.comms.base.arrays import IntArray
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.timing import (
    DSSS_RATES_BPS,
    ESB,
    ESB_CONTROL_BITS,
    HT_BITS_PER_SYMBOL,
    IEEE_802_11A,
    IEEE_802_11B,
    IEEE_802_11G,
    IEEE_802_11N_2_GHZ,
    IEEE_802_11N_5_GHZ,
    OFDM_MANDATORY_BPS,
    SIGNAL_EXTENSION_NS,
    Dcf,
    at_bit_rate_ns,
    ieee80211a_ns,
    ieee80211b_ns,
    ieee80211g_ns,
    ieee80211n_ns,
)

BAND_5_GHZ_HZ = 3e9  # lowest carrier of 802.11n that counts as the band at 5 GHz


def is_2_ghz(radio: Radio) -> bool:
    """Return True for a radio in the band at 2.4 GHz."""
    return radio.frequency_hz < BAND_5_GHZ_HZ


def dcf_of(radio: Radio) -> Dcf:
    """Return the timing of a radio's channel access with DCF or EDCA."""
    if radio.frame == "802.11n":
        return IEEE_802_11N_2_GHZ if is_2_ghz(radio) else IEEE_802_11N_5_GHZ
    return {"802.11a": IEEE_802_11A, "802.11g": IEEE_802_11G}.get(radio.frame, IEEE_802_11B)


ACK_802154_BYTES = 11  # preamble, delimiter, length and PSDU
ACK_80211_BYTES = 14  # PSDU


def airtime_ns(radio: Radio, frame_bytes: IntArray) -> IntArray:
    """Airtime of frames of these sizes, overhead included, in ns, (k,)."""
    if radio.lora_or_none is not None:
        return radio.lora_or_none.airtime_ns(frame_bytes)
    if radio.frame == "802.11b":
        return ieee80211b_ns(frame_bytes, radio.bit_rate_bps)
    if radio.frame == "802.11a":
        return ieee80211a_ns(frame_bytes, radio.bit_rate_bps)
    if radio.frame == "802.11g":
        return ieee80211g_ns(frame_bytes, radio.bit_rate_bps)
    if radio.frame == "802.11n":
        return ieee80211n_ns(frame_bytes, radio.bit_rate_bps) + signal_extension_ns(radio)
    if radio.frame == "esb":
        return ESB.airtime_ns(frame_bytes, radio.bit_rate_bps)
    return at_bit_rate_ns(frame_bytes, radio.bit_rate_bps)


def range_rate_bps(radio: Radio) -> int:
    """Bit rate of the data frames that reach farthest: with rate control the lowest."""
    return min(HT_BITS_PER_SYMBOL) if radio.access_or_default.rate_control != "fixed" else radio.bit_rate_bps


def broadcast_rate_bps(radio: Radio) -> int:
    """Bit rate of broadcasts: with 802.11n OFDM's lowest, which every station decodes; else that of all frames."""
    return OFDM_MANDATORY_BPS[0] if radio.frame == "802.11n" else radio.bit_rate_bps


def broadcast_airtime_ns(radio: Radio, frame_bytes: IntArray) -> IntArray:
    """Airtime of broadcasts of these sizes, overhead included, in ns, (k,)."""
    return airtime_ns(
        replace(radio, frame=_frame_of_control(radio), bit_rate_bps=broadcast_rate_bps(radio)), frame_bytes
    )


def signal_extension_ns(radio: Radio) -> int:
    """Return the signal extension of 802.11n, and of the OFDM frames among its frames, in ns; 0 at 5 GHz."""
    return SIGNAL_EXTENSION_NS if is_2_ghz(radio) else 0


def frame_bits(radio: Radio, frame_bytes: IntArray) -> IntArray:
    """Bits of frames of these sizes that may be wrong, (k,)."""
    return 8 * frame_bytes + (ESB_CONTROL_BITS if radio.frame == "esb" else 0)


def acknowledgement_bytes(radio: Radio) -> int:
    """Size of an acknowledgement; of esb, that of a null packet."""
    if radio.frame == "esb":
        return ESB.null_octets + radio.overhead_bytes
    return ACK_802154_BYTES if radio.frame in ("plain", "lora") else ACK_80211_BYTES


def acknowledgement_rate_bps(radio: Radio) -> int:
    """Bit rate of acknowledgements: OFDM's highest mandatory rate up to that of the frame (802.11-2007, 9.6).

    An MCS stands for OFDM's rate of the same modulation and code, at least 54 Mbit/s for MCS 7 (2009: 9.6.0e.5.3).
    """
    if radio.frame in ("802.11a", "802.11g", "802.11n"):
        return max(rate_bps for rate_bps in OFDM_MANDATORY_BPS if rate_bps <= radio.bit_rate_bps)
    return radio.bit_rate_bps


def acknowledgement_ns(radio: Radio) -> int:
    """Airtime of an acknowledgement, in ns."""
    radio = replace(radio, frame=_frame_of_control(radio), bit_rate_bps=acknowledgement_rate_bps(radio))
    return int(airtime_ns(radio, np.array([acknowledgement_bytes(radio)]))[0])


def eifs_acknowledgement_ns(radio: Radio) -> int:
    """Airtime of the acknowledgement in EIFS, in ns: at the lowest mandatory bit rate, 802.11b's at 2.4 GHz."""
    if _frame_of_control(radio) == "802.11a":
        return int(ieee80211a_ns(ACK_80211_BYTES, OFDM_MANDATORY_BPS[0]))
    return int(ieee80211b_ns(ACK_80211_BYTES, DSSS_RATES_BPS[0]))


def _frame_of_control(radio: Radio) -> str:
    """Return the frame of control frames: those of 802.11n are OFDM frames of 802.11a or g."""
    if radio.frame == "802.11n":
        return "802.11g" if is_2_ghz(radio) else "802.11a"
    return radio.frame
