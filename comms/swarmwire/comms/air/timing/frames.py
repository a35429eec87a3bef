"""Frames: how long packets occupy the air, by the way in which the radio frames them."""

from swarmwire.comms.air.radio import Radio
from swarmwire.comms.air.timing.airtime import at_bit_rate_ns, ieee80211a_ns, ieee80211b_ns, ieee80211g_ns
from swarmwire.comms.arrays import IntArray

# Octets of an acknowledgement: preamble, delimiter, length and PSDU of IEEE 802.15.4; the PSDU of IEEE 802.11.
SHORT_ACKNOWLEDGEMENT, LONG_ACKNOWLEDGEMENT = 11, 14


def airtime_ns(radio: Radio, frame_bytes: IntArray) -> IntArray:
    """How long frames of so many bytes, overhead included, occupy the air, in ns, (k,)."""
    if radio.frame == "802.11b":
        return ieee80211b_ns(frame_bytes, radio.bit_rate_bps, short_preamble=False)
    if radio.frame == "802.11a":
        return ieee80211a_ns(frame_bytes, radio.bit_rate_bps)
    if radio.frame == "802.11g":
        return ieee80211g_ns(frame_bytes, radio.bit_rate_bps)
    return at_bit_rate_ns(frame_bytes, radio.bit_rate_bps)


def acknowledgement_bytes(radio: Radio) -> int:
    """The size of an acknowledgement."""
    return SHORT_ACKNOWLEDGEMENT if radio.frame == "plain" else LONG_ACKNOWLEDGEMENT
