"""Scenario tables of the PHY: propagation beyond path loss, reception, noise and channel access.

No kernels: a scenario is read without a compiler.
"""

from dataclasses import dataclass
from itertools import pairwise

from swarmwire.comms.base import math as portable
from swarmwire.comms.base.config import parameter
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.radio.timing import DSSS_RATES_BPS, HT_BITS_PER_SYMBOL, OFDM_BITS_PER_SYMBOL

FADINGS = ("rayleigh", "rician", "nakagami")


@dataclass(frozen=True)
class Shadowing:
    """Strength and correlation distance of the loss in the surroundings."""

    deviation_db: float = parameter(
        4.0, help="sigma: standard deviation of the loss on long links", unit="dB", at_least=0, at_most=40
    )
    correlation_m: float = parameter(
        5.0, help="delta: distance over which the surroundings change", unit="m", above=0, at_most=10_000
    )


@dataclass(frozen=True)
class Walls:
    """Loss in obstacles. ns-3's buildings: wood 4 dB, concrete with windows 7, stone 12, concrete 15."""

    crossing_db: float = parameter(
        5.0, help="loss in each obstacle on the line between two robots", unit="dB", at_least=0, at_most=1000
    )
    inside_db_per_m: float = parameter(
        0.0, help="loss in obstacles per metre of the line inside them", unit="dB/m", at_least=0, at_most=100_000
    )


@dataclass(frozen=True)
class Bodies:
    """Loss in robots between sender and receiver."""

    crossing_db: float = parameter(
        1.0, help="loss in each robot on the line between sender and receiver", unit="dB", at_least=0, at_most=1000
    )


@dataclass(frozen=True)
class Fading:
    """Variation of a link's power over fractions of a wavelength."""

    distribution: str = parameter("rayleigh", help="distribution of the power", choices=FADINGS)
    k: float = parameter(
        4.0, help="rician only: power of the direct wave / power of all others", at_least=0, at_most=1e6
    )
    m: float = parameter(
        1.5, help="nakagami only: 1 is rayleigh, less is worse, more is milder", at_least=0.5, at_most=200
    )


RATES_BPS = {
    "802.11b": DSSS_RATES_BPS,
    "802.11ag": (*OFDM_BITS_PER_SYMBOL, *HT_BITS_PER_SYMBOL),
    "802.11ag-nist": (*OFDM_BITS_PER_SYMBOL, *HT_BITS_PER_SYMBOL),
}


@dataclass(frozen=True)
class SuccessTable:
    """Success of frames of `frame_bits` bits by SINR: linear in dB between rows, constant beyond the first and last."""

    sinr_db: tuple[float, ...] = parameter(help="signal to interference and noise, rising", unit="dB")
    success: tuple[float, ...] = parameter(help="probability that a frame is received, 0 to 1, never falling")
    frame_bits: int = parameter(help="bits of the frames that were measured", unit="bit", at_least=1)


def refuse_unless_rising(table: SuccessTable, where: str, key: str) -> None:
    """Raise `BadInput` unless SINR rises from row to row and success does not fall and stays within 0 and 1."""
    if len(table.sinr_db) != len(table.success) or len(table.sinr_db) < 2:
        raise BadInput(where, f"{key}.success", "expected a value for each of at least two rows of sinr_db")
    if not all(low < high for low, high in pairwise(table.sinr_db)):
        raise BadInput(where, f"{key}.sinr_db", "expected values that rise from row to row")
    if not all(low <= high for low, high in pairwise((0.0, *table.success, 1.0))):
        raise BadInput(where, f"{key}.success", "expected values from 0 to 1 that never fall")


@dataclass(frozen=True)
class Reception:
    """Frames that a receiver decodes in noise and interference."""

    model: str = parameter(
        "802.15.4",
        help="error model: from SINR to the probability of success",
        choices=("threshold", "table", "802.15.4", "802.11b", "802.11ag", "802.11ag-nist", "gazebo"),
    )
    min_sinr_db: float = parameter(
        6.0, help="threshold only: least SINR of a received frame", unit="dB", at_least=-100, at_most=100
    )
    table: SuccessTable | None = parameter(None, help="table only: success by SINR")
    preamble_sinr_db: float = parameter(
        -5.0, help="a receiver locks onto a frame above this SINR, until the frame ends", unit="dB"
    )
    preamble_dbm: float = parameter(-200.0, help="a receiver locks onto no frame below this power", unit="dBm")
    capture_window_s: float = parameter(
        0.0,
        help="time after its start in which a frame is displaced by a stronger one; 0: only by one that starts with it",
        unit="s",
        at_least=0,
        at_most=1,
    )
    sensitivity_dbm: float | None = parameter(
        None,
        help="least mean power that counts as in range; default: the sensitivity as data sheets define it",
        unit="dBm",
        at_least=-200,
        at_most=100,
    )


def refuse_unfit(reception: Reception, bit_rate_bps: int, where: str, key: str) -> None:
    """Raise `BadInput` for a model without its table, or without this bit rate.

    `where` is the scenario's file and `key` the key of the reception, such as "radio.reception".
    """
    if reception.model == "table":
        if reception.table is None:
            raise BadInput(where, f"{key}.table", 'is missing; the model "table" needs it')
        refuse_unless_rising(reception.table, where, f"{key}.table")
    rates_bps = RATES_BPS.get(reception.model, (bit_rate_bps,))
    if bit_rate_bps not in rates_bps:
        listed = ", ".join(str(rate_bps) for rate_bps in rates_bps)
        raise BadInput(where, f"{key}.model", f"{reception.model} has the bit rates {listed}; got {bit_rate_bps} bit/s")


BOLTZMANN_J_PER_K = 1.380649e-23  # exact, SI 2019
ROOM_K = 290.0  # the temperature at which noise figures are defined (IEEE)


def noise_dbm(bandwidth_hz: float, noise_figure_db: float = 0.0) -> float:
    """Noise power k T B F in dBm: -173.975 dBm in 1 Hz at 290 K, plus the receiver's noise figure."""
    return 10.0 * portable.log10(1e3 * BOLTZMANN_J_PER_K * ROOM_K * bandwidth_hz) + noise_figure_db


@dataclass(frozen=True)
class ReceiverNoise:
    """Thermal noise of a receiver."""

    bandwidth_hz: float = parameter(2e6, help="bandwidth of the receiver", unit="Hz", above=0, at_most=1e12)
    figure_db: float = parameter(
        6.0,
        help="noise figure: noise of the receiver above thermal noise",
        unit="dB",
        at_least=0,
        at_most=200,
    )

    @property
    def power_dbm(self) -> float:
        """Noise in the receiver's bandwidth at 290 K, in dBm."""
        return noise_dbm(self.bandwidth_hz, self.figure_db)


MAX_CHANNELS = 3  # advertising channels 37, 38 and 39 of Bluetooth LE


@dataclass(frozen=True)
class Advertising:
    """Bluetooth LE: each packet is an advertising event, and robots scan while they do not send."""

    channels: int = parameter(
        MAX_CHANNELS,
        help="channels on which an event sends its PDU in turn, and which a scanner visits in turn",
        at_least=1,
        at_most=MAX_CHANNELS,
    )
    gap_s: float = parameter(
        150e-6,
        help="time from the end of a PDU to the begin of the next; default: Zephyr's",
        unit="s",
        at_least=0,
        at_most=0.01,
    )
    max_delay_s: float = parameter(
        0.01, help="advDelay: an event is delayed by 0 to this, drawn for each packet", unit="s", at_least=0, at_most=1
    )
    scan_interval_s: float = parameter(
        0.03,
        help="time from scan to scan, each on the next channel; default: Zephyr's for continuous scanning",
        unit="s",
        at_least=0.0025,
        at_most=40.96,
    )
    scan_window_s: float | None = parameter(
        None,
        help="duration of a scan, at most scan_interval_s; default: scan_interval_s",
        unit="s",
        at_least=0.0025,
        at_most=40.96,
    )


RATE_CONTROLS = ("fixed", "ideal", "aarf")
METHODS = ("none", "aloha", "csma-802154", "dcf", "esb", "cad", "advertising")


@dataclass(frozen=True)
class Access:
    """Channel access: when a radio may send, and whether overlapping frames interfere."""

    method: str = parameter(
        "none",
        help="none: frames never interfere; aloha: frames interfere, and radios send at once; csma-802154: unslotted "
        "CSMA/CA; dcf: CSMA/CA of IEEE 802.11; esb: a station polls all others, which only answer; cad: channel "
        "activity detection of LoRa; advertising: aloha on the advertising channels of Bluetooth LE",
        choices=METHODS,
    )
    acknowledged: bool = parameter(
        True,
        help="CSMA/CA and DCF only: unicast packets are acknowledged, or else sent again",
    )
    cca_threshold_dbm: float | None = parameter(
        None,
        help="power from which the medium is busy; default: 10 dB above sensitivity (csma-802154), -62 dBm (dcf)",
        unit="dBm",
        at_least=-200,
        at_most=100,
    )
    cca_sensitivity_dbm: float | None = parameter(
        None,
        help="DCF only: power from which a frame makes the medium busy, also if it is not received; default: -82 dBm",
        unit="dBm",
        at_least=-200,
        at_most=100,
    )
    cca_time_s: float | None = parameter(
        None,
        help="DCF only: time until carrier sense reports a frame that starts; stations due earlier send; default: 4 us",
        unit="s",
        at_least=0,
        at_most=1,
    )
    max_retries: int | None = parameter(
        None,
        help="retries of a unicast packet, up to 7, of a poll (ARC) up to 15; default: 3 (csma-802154, esb) or 6 (dcf),"
        " with 802.11n no limit but queue_lifetime_s",
        at_least=0,
        at_most=15,
    )
    station: str | None = parameter(
        None,
        help="esb only: the robot, or the group of robots, that polls all others; default: the first robot",
    )
    host_delay_s: float = parameter(
        0.0,
        help="esb only: time that the station's computer and USB take for an exchange beyond the radio's own",
        unit="s",
        at_least=0,
        at_most=1,
    )
    aggregation_bytes: int | None = parameter(
        None,
        help="802.11n only: most bytes of packets that one frame aggregates (A-MPDU); 0: none; default: 65535",
        unit="byte",
        at_least=0,
        at_most=65535,
    )
    rts_threshold_bytes: int | None = parameter(
        None,
        help="802.11n only: RTS and CTS precede frames of more bytes to one robot; default: none",
        unit="byte",
        at_least=0,
        at_most=65535,
    )
    rate_control: str = parameter(
        "fixed",
        help="802.11n only: bit rate of packets to one robot, at most bit_rate_bps. fixed: that rate; ideal: the "
        "highest for the last SINR at the receiver; aarf: by successes and failures",
        choices=RATE_CONTROLS,
    )
    safelink: bool = parameter(
        False,
        help="esb only: cflib's Safelink: packets are repeated in further exchanges until they are acknowledged; true "
        "behind --gateway crazyflie",
    )

    @property
    def acknowledges(self) -> bool:
        """True if senders get a transmit status for each unicast packet."""
        return self.acknowledged and self.method in ("csma-802154", "dcf", "esb")
