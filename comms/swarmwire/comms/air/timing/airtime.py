"""Airtime: how long a frame occupies the air, in whole ns. Octets may be a number or an array of integers.

Which octets count is stated with each standard; headers of higher layers are the caller's to add.
"""

from typing import TypeVar

from swarmwire.comms.arrays import IntArray
from swarmwire.comms.clock import NS_PER_S

Octets = TypeVar("Octets", int, IntArray)

US = 1_000  # ns
DSSS_RATES_BPS = (1_000_000, 2_000_000, 5_500_000, 11_000_000)
OFDM_BITS_PER_SYMBOL = {
    6_000_000: 24,
    9_000_000: 36,
    12_000_000: 48,
    18_000_000: 72,
    24_000_000: 96,
    36_000_000: 144,
    48_000_000: 192,
    54_000_000: 216,
}


def at_bit_rate_ns(octets: Octets, bit_rate_bps: int) -> Octets:
    """8 x octets / bit rate, rounded up: a radio without further structure.

    So is IEEE 802.15.4 at 2.4 GHz: 250 kbit/s, and 6 octets of preamble, delimiter and length before a PSDU of at most
    127.
    """
    return -(-octets * 8 * NS_PER_S // bit_rate_bps)


def ieee80211b_ns(psdu_octets: Octets, rate_bps: int, *, short_preamble: bool) -> Octets:
    """IEEE 802.11b: 192 us (short preamble 96) + 8 x PSDU / rate, rounded up to whole us (18.2.3.5).

    The PSDU holds MAC header (24 octets), FCS (4) and what is between. There is no short preamble at 1 Mbit/s.
    """
    return (96 if short_preamble else 192) * US - (-psdu_octets * 8_000_000 // rate_bps) * US


def ieee80211a_ns(psdu_octets: Octets, rate_bps: int) -> Octets:
    """IEEE 802.11a: 20 us + 4 us x ceil((22 + 8 x PSDU) / bits per symbol) (17.4.3)."""
    return 20 * US - (-(22 + 8 * psdu_octets) // OFDM_BITS_PER_SYMBOL[rate_bps]) * 4 * US


def ieee80211g_ns(psdu_octets: Octets, rate_bps: int) -> Octets:
    """IEEE 802.11g (OFDM at 2.4 GHz): as 802.11a, and 6 us of silence for the receiver (19.8.3)."""
    return ieee80211a_ns(psdu_octets, rate_bps) + 6 * US
