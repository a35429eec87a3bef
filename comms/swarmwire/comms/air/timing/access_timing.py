"""Access timing: what the standards prescribe for the wait before a frame goes on air. All times in ns."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import IntArray

US = 1_000  # ns


@dataclass(frozen=True, slots=True)
class UnslottedCsma:
    """Unslotted CSMA/CA of IEEE 802.15.4 at 2.4 GHz, with the standard's defaults (2006: 6.4.2, 7.4.2, 7.5.1.4).

    A sender waits U{0 .. 2^BE - 1} backoff periods, then listens for `cca_ns`; if the air is busy BE grows by one, and
    after more than `most_backoffs` busy times the frame fails. Sent `turnaround_ns` after the air was found free.
    """

    symbol_ns: int = 16 * US
    backoff_ns: int = 320 * US  # aUnitBackoffPeriod, 20 symbols
    cca_ns: int = 128 * US  # 8 symbols
    busy_above_sensitivity_db: float = 10.0  # energy that counts as busy (6.9.9)
    turnaround_ns: int = 192 * US  # aTurnaroundTime, 12 symbols
    short_space_ns: int = 192 * US  # SIFS, 12 symbols: after frames of up to `short_frame_octets`
    long_space_ns: int = 640 * US  # LIFS, 40 symbols
    short_frame_octets: int = 18  # aMaxSIFSFrameSize
    acknowledgement_wait_ns: int = 864 * US  # macAckWaitDuration, 54 symbols
    least_exponent: int = 3  # macMinBE
    most_exponent: int = 5  # macMaxBE
    most_backoffs: int = 4  # macMaxCSMABackoffs
    most_retries: int = 3  # macMaxFrameRetries, of unicast frames

    def space_ns(self, psdu_octets: IntArray) -> IntArray:
        """The silence that follows frames of so many octets, (k,)."""
        return np.where(psdu_octets <= self.short_frame_octets, self.short_space_ns, self.long_space_ns)


@dataclass(frozen=True, slots=True)
class Dcf:
    """The distributed coordination function of IEEE 802.11 (2007: 9.2, and 15 to 19 for the numbers).

    A sender waits until the air was free for DIFS, then U{0 .. CW} slots of free air. A broadcast goes out at a basic
    rate, without acknowledgement and retries, so its CW stays at the least.
    """

    short_space_ns: int  # SIFS
    slot_ns: int
    least_window: int  # CWmin, slots
    most_window: int = 1023  # CWmax, slots
    most_retries: int = 7  # of short unicast frames
    busy_energy_dbm: float = -62.0  # anything else

    @property
    def difs_ns(self) -> int:
        """SIFS + 2 slots."""
        return self.short_space_ns + 2 * self.slot_ns


IEEE_802_15_4 = UnslottedCsma()
IEEE_802_11B = Dcf(10 * US, 20 * US, 31)  # of frames by DSSS and CCK
IEEE_802_11A = Dcf(16 * US, 9 * US, 15)  # of frames by OFDM at 5 GHz
IEEE_802_11G = Dcf(10 * US, 9 * US, 15)  # where no station of 802.11b is near: short slots, CWmin of OFDM
