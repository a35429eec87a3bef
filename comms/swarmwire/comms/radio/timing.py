"""Timing of the standards: airtime of a frame, and channel access (IFS, CCA, backoff, contention window, polling).

Times are whole ns. Octets may be a number or an array of integers. Each standard states the octets that count; callers
add the headers of higher layers.
"""

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from swarmwire.comms.base.arrays import IntArray
from swarmwire.comms.base.clock import NS_PER_S

Octets = TypeVar("Octets", int, IntArray)

US = 1_000  # ns
DSSS_RATES_BPS = (1_000_000, 2_000_000, 5_500_000, 11_000_000)
OFDM_MANDATORY_BPS = (6_000_000, 12_000_000, 24_000_000)  # (17.3.1); all rates of DSSS are mandatory (18.1.1)
ESB_RATES_BPS = (250_000, 1_000_000, 2_000_000)
ESB_CONTROL_BITS = 9  # length 6, packet identity 2, no acknowledgement 1
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
HT_BITS_PER_SYMBOL = {  # MCS 0 to 7 (20.6): one spatial stream in 20 MHz with the long guard interval
    6_500_000: 26,
    13_000_000: 52,
    19_500_000: 78,
    26_000_000: 104,
    39_000_000: 156,
    52_000_000: 208,
    58_500_000: 234,
    65_000_000: 260,
}
SIGNAL_EXTENSION_NS = 6 * US  # of OFDM frames at 2.4 GHz (19.8.3, 20.4.3)


def at_bit_rate_ns(octets: Octets, bit_rate_bps: int) -> Octets:
    """Return 8 x octets / bit rate, rounded up: the airtime of frames without further structure.

    IEEE 802.15.4 at 2.4 GHz has such frames: 250 kbit/s, and 6 octets of preamble, delimiter and length before a PSDU
    of at most 127.
    """
    return -(-octets * 8 * NS_PER_S // bit_rate_bps)


def ieee80211b_ns(psdu_octets: Octets, rate_bps: int) -> Octets:
    """Return the airtime of IEEE 802.11b: 192 us (long preamble) + 8 x PSDU / rate, rounded up to us (18.2.3.5).

    The PSDU holds MAC header (24 octets), frame body and FCS (4).
    """
    return 192 * US - (-psdu_octets * 8_000_000 // rate_bps) * US


def ieee80211a_ns(psdu_octets: Octets, rate_bps: int) -> Octets:
    """Return the airtime of IEEE 802.11a: 20 us + 4 us x ceil((22 + 8 x PSDU) / bits per symbol) (17.4.3)."""
    return 20 * US - (-(22 + 8 * psdu_octets) // OFDM_BITS_PER_SYMBOL[rate_bps]) * 4 * US


def ieee80211g_ns(psdu_octets: Octets, rate_bps: int) -> Octets:
    """Return the airtime of IEEE 802.11g (OFDM at 2.4 GHz): 802.11a and the signal extension (19.8.3)."""
    return ieee80211a_ns(psdu_octets, rate_bps) + SIGNAL_EXTENSION_NS


def ieee80211n_ns(psdu_octets: Octets, rate_bps: int) -> Octets:
    """Return the airtime of IEEE 802.11n at 5 GHz, HT-mixed: 36 us + 4 us x ceil((22 + 8 x PSDU) / bits per symbol).

    The preamble has the fields of 802.11a (20 us), HT-SIG (8), HT-STF and one HT-LTF (4 each) (2009: 20.4.3).
    """
    return 36 * US - (-(22 + 8 * psdu_octets) // HT_BITS_PER_SYMBOL[rate_bps]) * 4 * US


def lora_symbol_ns(spreading_factor: int, bandwidth_hz: int) -> int:
    """Return the symbol time of LoRa, 2^SF / BW: whole ns at 125, 250 and 500 kHz."""
    return NS_PER_S * 2**spreading_factor // bandwidth_hz


def lora_ns(
    payload_octets: Octets,
    spreading_factor: int,
    bandwidth_hz: int,
    *,
    parity_bits: int = 1,
    preamble_symbols: int = 8,
    explicit_header: bool = True,
    crc: bool = True,
    low_data_rate: bool = False,
) -> Octets:
    """Return the airtime of LoRa: (n + 4.25 + 8 + max(ceil(bits / (4 (SF - 2 DE))) (CR + 4), 0)) symbols.

    bits = 8 PL - 4 SF + 28 + 16 CRC - 20 IH. CR is `parity_bits`, 1 (4/5) to 4 (4/8); n is `preamble_symbols`; CRC and
    DE (low data rate) are 1 if on; IH is 1 for an implicit header (SX1276 data sheet, rev. 7, 4.1.1.7).
    """
    bits = 8 * payload_octets - 4 * spreading_factor + 28 + 16 * crc - 20 * (not explicit_header)
    blocks = -(-bits // (4 * (spreading_factor - 2 * low_data_rate)))
    quarter_symbols = 4 * (preamble_symbols + 8) + 17 + 4 * (parity_bits + 4) * (blocks * (blocks > 0))
    return quarter_symbols * (lora_symbol_ns(spreading_factor, bandwidth_hz) // 4)


@dataclass(frozen=True, slots=True)
class UnslottedCsma:
    """Unslotted CSMA/CA of IEEE 802.15.4 at 2.4 GHz, with the standard's defaults (2006: 6.4.2, 7.4.2, 7.5.1.4).

    A sender waits U{0 .. 2^BE - 1} backoff periods, then assesses the channel for `cca_ns`. If it is busy, BE grows by
    one; after more than `max_backoffs` busy CCAs the frame fails. A frame starts `turnaround_ns` after an idle CCA.
    """

    symbol_ns: int = 16 * US
    backoff_ns: int = 320 * US  # aUnitBackoffPeriod, 20 symbols
    cca_ns: int = 128 * US  # 8 symbols
    cca_ed_above_sensitivity_db: float = 10.0  # CCA-ED threshold (6.9.9)
    turnaround_ns: int = 192 * US  # aTurnaroundTime, 12 symbols
    sifs_ns: int = 192 * US  # SIFS, 12 symbols: after frames of up to `max_sifs_frame_octets`
    lifs_ns: int = 640 * US  # LIFS, 40 symbols
    max_sifs_frame_octets: int = 18  # aMaxSIFSFrameSize
    ack_wait_ns: int = 864 * US  # macAckWaitDuration, 54 symbols
    min_be: int = 3  # macMinBE
    max_be: int = 5  # macMaxBE
    max_backoffs: int = 4  # macMaxCSMABackoffs
    max_retries: int = 3  # macMaxFrameRetries, of unicast frames

    def ifs_ns(self, psdu_octets: IntArray) -> IntArray:
        """Return the interframe space after frames of `psdu_octets` octets, (k,)."""
        return np.where(psdu_octets <= self.max_sifs_frame_octets, self.sifs_ns, self.lifs_ns)


@dataclass(frozen=True, slots=True)
class Dcf:
    """The distributed coordination function of IEEE 802.11 (2007: 9.2, and 15 to 19 for the numbers).

    A sender waits until the medium was idle for DIFS, then U{0 .. CW} idle slots. A broadcast is sent at a basic rate,
    without acknowledgement and retries, so its CW stays at CWmin.
    """

    sifs_ns: int  # SIFS
    slot_ns: int
    cw_min: int  # CWmin, slots
    cw_max: int = 1023  # CWmax, slots
    max_retries: int = 6  # retries of short unicast frames: dot11ShortRetryLimit, 7, counts attempts (9.2.5.3)
    cca_time_ns: int = 4 * US  # aCCATime of OFDM; that of DSSS is at most 15 us, and 4 us in ns-3
    cca_sensitivity_dbm: float = -82.0  # power of frames that make the medium busy (17.3.10.5)
    cca_ed_dbm: float = -62.0  # CCA-ED threshold, for any other energy
    aifsn: int = 2  # slots of DIFS after SIFS; EDCA: AIFSN, of AIFS

    @property
    def difs_ns(self) -> int:
        """DIFS, or AIFS under EDCA: SIFS + `aifsn` slots."""
        return self.sifs_ns + self.aifsn * self.slot_ns


@dataclass(frozen=True, slots=True)
class Esb:
    """Enhanced ShockBurst of the nRF24LU1+, with the values that the Crazyradio's firmware sets.

    Source: Nordic, nRF24LU1+ Product Specification v1.0 (6.3.1.7, 6.4.3, 6.4.6.2, 6.4.9); crazyradio-firmware, radio.c.
    """

    turnaround_ns: int = 130 * US  # Tstby2a, from standby, or between sending and receiving
    upload_ns: int = 1 * US  # of an octet of a payload by SPI, at 8 Mbit/s
    max_retries: int = 3  # ARC
    max_payload_octets: int = 32
    null_octets: int = 1  # CRTP's null packet, which is sent when nothing waits

    def airtime_ns(self, frame_octets: Octets, rate_bps: int) -> Octets:
        """Return the airtime: preamble 1 octet, address 5, packet control 9 bits, payload, CRC 2.

        `frame_octets` are all but packet control.
        """
        return -(-(8 * frame_octets + ESB_CONTROL_BITS) * NS_PER_S // rate_bps)

    def ard_ns(self, rate_bps: int) -> int:
        """Return the auto-retransmit delay ARD, in steps of 250 us, for acknowledgements with 32 octets of payload.

        It begins at the end of the frame.
        """
        return 1500 * US if rate_bps == ESB_RATES_BPS[0] else 500 * US

    def irq_ns(self, rate_bps: int) -> int:
        """Return T_IRQ, the delay of the interrupt; the specification has none for 250 kbit/s: as for 1 Mbit/s."""
        return 6 * US if rate_bps == ESB_RATES_BPS[-1] else 8_200


ESB = Esb()


CAD_QUARTER_SYMBOLS = 9  # 2.25 symbols, the longest CAD of an SX127x
CAD_HANDLING_NS = 7_600 * US  # propagation over 30 km, turnaround and processing, as Meshtastic adds them up


def lora_cad(symbol_ns: int, turnaround_ns: int) -> UnslottedCsma:
    """Return the access of Meshtastic: U{0 .. 2^CW - 1} slots, then channel activity detection (CAD), until it is idle.

    A slot is 2.5 symbols, the longest CAD of its chips, and 7.6 ms; a CAD of an SX127x takes 2.25. CW is 3 and grows to
    8, by one with each busy CAD; Meshtastic takes it from the utilisation of the channel in the last minute (firmware
    2.7.15, RadioInterface.cpp). A CAD detects frames that a receiver could decode.
    """
    cad_ns = CAD_QUARTER_SYMBOLS * symbol_ns // 4
    return UnslottedCsma(
        symbol_ns=symbol_ns,
        backoff_ns=5 * symbol_ns // 2 + CAD_HANDLING_NS,
        cca_ns=cad_ns,
        cca_ed_above_sensitivity_db=0.0,
        turnaround_ns=turnaround_ns,
        min_be=3,
        max_be=8,
        max_backoffs=10**9,
    )


IEEE_802_15_4 = UnslottedCsma()
IEEE_802_11B = Dcf(10 * US, 20 * US, 31)  # DSSS and CCK
IEEE_802_11A = Dcf(16 * US, 9 * US, 15)  # OFDM at 5 GHz
IEEE_802_11G = Dcf(10 * US, 20 * US, 15)  # OFDM in an ad hoc network (IBSS), which has no short slots (7.3.1.4)
# EDCA with the parameters of best effort (2009: 7.3.2.29).
IEEE_802_11N_2_GHZ = replace(IEEE_802_11G, aifsn=3)
IEEE_802_11N_5_GHZ = replace(IEEE_802_11A, aifsn=3)
