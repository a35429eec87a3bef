"""Scenario tables of the PHY: antennas, propagation beyond path loss, reception, noise and channel access.

No kernels here: a scenario is read without a compiler.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.config import parameter
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.radio.timing import DSSS_RATES_BPS, OFDM_BITS_PER_SYMBOL

FADINGS = ("rayleigh", "rician", "nakagami")


@dataclass(frozen=True)
class Antenna:
    """What a robot's radio puts on air and takes from it; the same in all directions."""

    power_dbm: float = parameter(0.0, help="transmit power into the antenna", unit="dBm", at_least=-100, at_most=100)
    gain_dbi: float = parameter(
        0.0, help="gain of the antenna, for what it sends and what it hears", unit="dBi", at_least=-100, at_most=100
    )


@dataclass(frozen=True)
class RobotAntenna:
    """What the antennas of a group's robots have of their own, instead of what `[radio.antenna]` says."""

    power_dbm: float | None = parameter(
        None, help="their transmit power into the antenna", unit="dBm", at_least=-100, at_most=100
    )
    gain_dbi: float | None = parameter(
        None, help="the gain of their antenna, for what they send and hear", unit="dBi", at_least=-100, at_most=100
    )


@dataclass(frozen=True)
class Shadowing:
    """How strongly and over which distance the surroundings vary."""

    deviation_db: float = parameter(
        4.0, help="sigma: standard deviation of the loss on long links", unit="dB", at_least=0, at_most=40
    )
    correlation_m: float = parameter(
        5.0, help="delta: distance over which the surroundings change", unit="m", above=0, at_most=10_000
    )


@dataclass(frozen=True)
class Walls:
    """What obstacles take. ns-3's buildings have 4 dB for wood, 7 concrete with windows, 12 stone, 15 concrete."""

    crossing_db: float = parameter(
        5.0, help="loss in each obstacle on the line between two robots", unit="dB", at_least=0, at_most=1000
    )
    inside_db_per_m: float = parameter(
        0.0, help="loss in obstacles per metre of the line inside them", unit="dB/m", at_least=0, at_most=100_000
    )


@dataclass(frozen=True)
class Bodies:
    """What robots take that stand between two others."""

    crossing_db: float = parameter(
        1.0, help="loss in each robot on the line between two others", unit="dB", at_least=0, at_most=1000
    )


@dataclass(frozen=True)
class Fading:
    """How a link's power varies over fractions of a wavelength."""

    distribution: str = parameter("rayleigh", help="how waves arrive", choices=FADINGS)
    k: float = parameter(
        4.0, help="of rician: power of the direct wave over that of all others", at_least=0, at_most=1e6
    )
    m: float = parameter(
        1.5, help="of nakagami: 1 is rayleigh, less is worse, more is milder", at_least=0.5, at_most=200
    )


@dataclass(frozen=True, slots=True)
class Antennas:
    """What robots have of their own, by index in the arena; NaN where they have what `[radio.antenna]` says."""

    power_dbm: FloatArray  # (robots,)
    gain_dbi: FloatArray  # (robots,)

    @classmethod
    def of_groups(cls, groups: Iterable[tuple[int, RobotAntenna | None]]) -> "Antennas":
        """Those of groups of so many robots each, in their order."""
        given = [(count, own or RobotAntenna()) for count, own in groups]
        counts = [count for count, _ in given]
        power_dbm = [np.nan if own.power_dbm is None else own.power_dbm for _, own in given]
        gain_dbi = [np.nan if own.gain_dbi is None else own.gain_dbi for _, own in given]
        return cls(np.repeat(power_dbm, counts), np.repeat(gain_dbi, counts))

    @classmethod
    def alike(cls, robots: int) -> "Antennas":
        """So many robots that have nothing of their own."""
        return cls.of_groups([(robots, None)])

    def send_dbm(self, antenna: Antenna) -> FloatArray:
        """What each robot radiates, power and gain, (robots,); `antenna` is the radio's."""
        return _or(self.power_dbm, antenna.power_dbm) + self.receive_dbi(antenna)

    def receive_dbi(self, antenna: Antenna) -> FloatArray:
        """The gain of each robot's antenna, (robots,)."""
        return _or(self.gain_dbi, antenna.gain_dbi)


def _or(own: FloatArray, otherwise: float) -> FloatArray:
    return np.where(np.isnan(own), otherwise, own)


RATES_BPS = {
    "802.11b": DSSS_RATES_BPS,
    "802.11ag": tuple(OFDM_BITS_PER_SYMBOL),
    "802.11ag-nist": tuple(OFDM_BITS_PER_SYMBOL),
}


@dataclass(frozen=True)
class SuccessTable:
    """Success of frames of `frame_bits` bits by SINR; between the rows a straight line in dB, beyond them the end's."""

    sinr_db: tuple[float, ...] = parameter(help="signal to interference and noise, rising", unit="dB")
    success: tuple[float, ...] = parameter(help="probability that a frame is right, 0 to 1, never falling")
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
    """How a receiver copes with noise and interference."""

    model: str = parameter(
        "802.15.4",
        help="what turns the ratio of signal to interference and noise into success",
        choices=("threshold", "table", "802.15.4", "802.11b", "802.11ag", "802.11ag-nist", "gazebo"),
    )
    min_sinr_db: float = parameter(
        6.0, help="of threshold: the ratio that a frame needs", unit="dB", at_least=-100, at_most=100
    )
    table: SuccessTable | None = parameter(None, help="of table: success by ratio")
    preamble_sinr_db: float = parameter(
        -5.0, help="a receiver finds a frame above this ratio, and nothing else until its end", unit="dB"
    )
    preamble_dbm: float = parameter(-200.0, help="a receiver finds no frame below this power", unit="dBm")
    capture_window_s: float = parameter(
        0.0,
        help="how long after its start a frame gives way to a stronger one; 0: only to one that starts with it",
        unit="s",
        at_least=0,
        at_most=1,
    )
    sensitivity_dbm: float | None = parameter(
        None,
        help="least mean power that counts as in range; without it, what a data sheet of this receiver would say",
        unit="dBm",
        at_least=-200,
        at_most=100,
    )


def refuse_unfit(reception: Reception, bit_rate_bps: int, where: str, key: str) -> None:
    """Raise `BadInput` for a model without its table, or one that has no such bit rate.

    `where` and `key` say where the scenario has the reception, "radio.reception" say.
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
    return 10.0 * math.log10(1e3 * BOLTZMANN_J_PER_K * ROOM_K * bandwidth_hz) + noise_figure_db


@dataclass(frozen=True)
class ReceiverNoise:
    """What a receiver adds to what it hears."""

    bandwidth_hz: float = parameter(2e6, help="bandwidth of the receiver", unit="Hz", above=0, at_most=1e12)
    figure_db: float = parameter(
        6.0,
        help="noise figure: how far what it hears is above thermal noise",
        unit="dB",
        at_least=0,
        at_most=200,
    )

    @property
    def power_dbm(self) -> float:
        """The noise in the receiver's bandwidth at 290 K, in dBm."""
        return noise_dbm(self.bandwidth_hz, self.figure_db)


METHODS = ("none", "aloha", "csma-802154", "dcf")


@dataclass(frozen=True)
class Access:
    """Channel access: when a radio may send, and whether overlapping frames interfere."""

    method: str = parameter(
        "none",
        help="none: frames never disturb one another; aloha: they do, and radios send at once; csma-802154: "
        "unslotted CSMA/CA; dcf: that of IEEE 802.11",
        choices=METHODS,
    )
    acknowledged: bool = parameter(
        True, help="of csma-802154 and dcf: addressed packets are acknowledged, and sent again if that fails"
    )
    cca_threshold_dbm: float | None = parameter(
        None,
        help="power from which the medium counts as busy; without it 10 dB above the sensitivity (csma-802154) or "
        "-62 dBm (dcf)",
        unit="dBm",
        at_least=-200,
        at_most=100,
    )
    cca_sensitivity_dbm: float | None = parameter(
        None,
        help="of dcf: power of frames from which the medium counts as busy, also if none of them is received; without "
        "it -82 dBm",
        unit="dBm",
        at_least=-200,
        at_most=100,
    )
    cca_time_s: float | None = parameter(
        None,
        help="of dcf: how long after its start a frame is sensed; who is due until then sends into it; without it 4 us",
        unit="s",
        at_least=0,
        at_most=1,
    )
    max_retries: int | None = parameter(
        None,
        help="how often an addressed packet is sent again; without it the standard's 3 (csma-802154) or 6 (dcf)",
        at_least=0,
        at_most=7,
    )

    @property
    def acknowledges(self) -> bool:
        """Whether senders get a transmit status for each unicast packet."""
        return self.acknowledged and self.method in ("csma-802154", "dcf")
