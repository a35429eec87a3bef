"""The scenario table `[radio.lora]`: modulation of LoRa (SX127x), duty cycle and dwell time; SNR limits and rejection.

No kernels: a scenario is read without a compiler.
"""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.base.config import parameter
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.radio.config.phy import Reception
from swarmwire.comms.radio.timing import Octets, lora_ns, lora_symbol_ns

BANDWIDTHS_HZ = (125_000, 250_000, 500_000)
CODING_RATES = ("4/5", "4/6", "4/7", "4/8")
SNR_LIMIT_DB = {7: -7.5, 8: -10.0, 9: -12.5, 10: -15.0, 11: -17.5, 12: -20.0}  # SX1276 data sheet, rev. 7, table 13
SPREADING_FACTORS = range(7, 13)
# Least SIR of a frame (row: SF7 to SF12) with one of another spreading factor (column) on air: Croce et al. 2018, table
# II, measured with an SX1272 at 125 kHz. Equal ones have CAPTURE_DB here, 1 dB there.
MIN_SIR_DB = (
    (6, -8, -9, -9, -9, -9),
    (-11, 6, -11, -12, -13, -13),
    (-15, -13, 6, -13, -14, -15),
    (-19, -18, -17, 6, -17, -18),
    (-22, -22, -21, -20, 6, -20),
    (-25, -25, -25, -24, -23, 6),
)
CAPTURE_DB = 6.0  # a frame survives others of its spreading factor if it is so much stronger (Bor et al. 2016)
LOCKING_SYMBOLS = 5  # of the preamble, without which a receiver does not lock (Bor et al. 2016)
MAX_LEAD_SYMBOLS = 3
MAX_FRAME_BYTES = 255  # length field of the explicit header
LOW_DATA_RATE_NS = 16_000_000  # from this symbol time on the optimisation is mandatory (data sheet, 4.1.1.6)

# Powers are compared at the detector, where `Lora.despreading_db` is taken off the noise: see there. A stronger frame
# takes the receiver whenever it starts, as in LoRaSim.
LORA_RECEPTION = Reception(
    model="threshold", min_sinr_db=CAPTURE_DB, preamble_sinr_db=CAPTURE_DB, capture_window_s=3600.0
)


@dataclass(frozen=True)
class Lora:
    """Modulation of LoRa, and limits on its airtime."""

    spreading_factor: int = parameter(7, help="bits per symbol", at_least=7, at_most=12)
    bandwidth_hz: int = parameter(
        125_000, help="bandwidth, also of the noise: 125, 250 or 500 kHz", unit="Hz", at_least=125_000, at_most=500_000
    )
    coding_rate: str = parameter("4/5", help="bits of data per bits sent", choices=CODING_RATES)
    preamble_symbols: int = parameter(8, help="programmed symbols of the preamble", at_least=6, at_most=65535)
    explicit_header: bool = parameter(True, help="frames have a header with their length")
    crc: bool = parameter(True, help="the payload has a checksum of 16 bits")
    low_data_rate: bool | None = parameter(
        None, help="low data rate optimisation; default: for symbols of 16 ms and longer"
    )
    duty_cycle: float | None = parameter(
        None,
        help="most airtime of a robot within an hour, as a share; packets that would exceed it are dropped; default: "
        "no limit",
        above=0,
        at_most=1,
    )
    max_airtime_s: float | None = parameter(
        None, help="longest allowed frame (dwell time); default: no limit", unit="s", above=0, at_most=60
    )

    @property
    def symbol_ns(self) -> int:
        """Symbol time in ns."""
        return lora_symbol_ns(self.spreading_factor, self.bandwidth_hz)

    @property
    def optimises_low_data_rate(self) -> bool:
        """True if the low data rate optimisation is on."""
        return self.symbol_ns >= LOW_DATA_RATE_NS if self.low_data_rate is None else self.low_data_rate

    def airtime_ns(self, frame_bytes: Octets) -> Octets:
        """Return the airtime of frames with this payload of LoRa, in ns."""
        return lora_ns(
            frame_bytes,
            self.spreading_factor,
            self.bandwidth_hz,
            parity_bits=CODING_RATES.index(self.coding_rate) + 1,
            preamble_symbols=self.preamble_symbols,
            explicit_header=self.explicit_header,
            crc=self.crc,
            low_data_rate=self.optimises_low_data_rate,
        )

    @property
    def lead_ns(self) -> int:
        """Time at a frame's start in which another frame neither disturbs it nor is disturbed: 3 symbols of 8.

        A receiver locks by the last 5 symbols of the preamble (Bor et al. 2016, critical section). At most 3 symbols of
        longer preambles count, since channel activity detection does not notice them.
        """
        return min(self.preamble_symbols - LOCKING_SYMBOLS, MAX_LEAD_SYMBOLS) * self.symbol_ns

    @property
    def despreading_db(self) -> float:
        """What the detector takes off the noise, but not off frames of the same spreading factor.

        S / (N / g + I) >= 6 dB is S / N >= the SNR limit without interference, and S / I >= 6 dB without noise, if g in
        dB is 6 dB - limit: 13.5 dB (SF7) to 26 dB (SF12).
        """
        return CAPTURE_DB - SNR_LIMIT_DB[self.spreading_factor]

    @property
    def max_airtime_ns(self) -> int | None:
        """The longest allowed frame in ns; None: no limit."""
        return None if self.max_airtime_s is None else round(self.max_airtime_s * NS_PER_S)


def refuse_unfit_lora(lora: Lora, overhead_bytes: int, max_payload_bytes: int, where: str) -> None:
    """Raise `BadInput` for another bandwidth, or a largest frame above the length field or the longest airtime."""
    if lora.bandwidth_hz not in BANDWIDTHS_HZ:
        listed = ", ".join(map(str, BANDWIDTHS_HZ))
        raise BadInput(where, "radio.lora.bandwidth_hz", f"expected one of {listed} (Hz), got {lora.bandwidth_hz}")
    largest = np.arange(MAX_FRAME_BYTES + 1)
    if lora.max_airtime_ns is not None:
        largest = largest[lora.airtime_ns(largest) <= lora.max_airtime_ns]
    allowed = len(largest) - 1 - overhead_bytes
    if max_payload_bytes > allowed:
        limit = f"{MAX_FRAME_BYTES} bytes" if lora.max_airtime_s is None else f"{lora.max_airtime_s:g} s"
        frame = f"a frame of SF{lora.spreading_factor} has at most {limit}, overhead_bytes included"
        if allowed < 2:
            raise BadInput(where, "radio.lora.max_airtime_s", f"expected time for a payload of 2 bytes: {frame}")
        raise BadInput(
            where, "radio.max_payload_bytes", f"expected at most {allowed}: {frame}; got {max_payload_bytes}"
        )
