"""What a scenario says of reception. No kernels here: a scenario is read without a compiler."""

from dataclasses import dataclass
from itertools import pairwise

from swarmwire.comms.air.timing.airtime import DSSS_RATES_BPS, OFDM_BITS_PER_SYMBOL
from swarmwire.comms.errors import BadInput
from swarmwire.comms.parameters import parameter

RATES_BPS = {"802.11b": DSSS_RATES_BPS, "802.11ag": tuple(OFDM_BITS_PER_SYMBOL)}


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
        choices=("threshold", "table", "802.15.4", "802.11b", "802.11ag"),
    )
    least_sinr_db: float = parameter(
        6.0, help="of threshold: the ratio that a frame needs", unit="dB", at_least=-100, at_most=100
    )
    table: SuccessTable | None = parameter(None, help="of table: success by ratio")
    preamble_sinr_db: float = parameter(
        -5.0, help="a receiver finds a frame above this ratio, and nothing else until its end", unit="dB"
    )
    preamble_dbm: float = parameter(-200.0, help="a receiver finds no frame below this power", unit="dBm")
    take_over_s: float = parameter(
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
