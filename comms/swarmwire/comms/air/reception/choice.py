"""Choice: which receiver a scenario asks for."""

from dataclasses import dataclass

from swarmwire.comms.air.reception import dsss, ofdm
from swarmwire.comms.air.reception.reception import (
    Receiver,
    by_table,
    by_threshold,
    ieee80211ag,
    ieee80211b,
    ieee802154,
)
from swarmwire.comms.air.reception.success_table import SuccessTable, refuse_unless_rising
from swarmwire.comms.errors import BadInput
from swarmwire.comms.parameters import parameter

RATES_BPS = {"802.11b": dsss.RATES_BPS, "802.11ag": ofdm.RATES_BPS}


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


def receiver_of(reception: Reception, bit_rate_bps: int, where: str, key: str) -> Receiver:
    """The receiver, at this bit rate if its model has several; raises `BadInput` for what does not go together.

    `where` and `key` say where the scenario has the reception, "radio.reception" say.
    """
    if reception.model == "threshold":
        return by_threshold(reception.least_sinr_db)
    if reception.model == "table":
        if reception.table is None:
            raise BadInput(where, f"{key}.table", 'is missing; the model "table" needs it')
        refuse_unless_rising(reception.table, where, f"{key}.table")
        return by_table(reception.table)
    if reception.model == "802.15.4":
        return ieee802154()
    rates_bps = RATES_BPS[reception.model]
    if bit_rate_bps not in rates_bps:
        listed = ", ".join(str(rate_bps) for rate_bps in rates_bps)
        raise BadInput(where, f"{key}.model", f"{reception.model} has the bit rates {listed}; got {bit_rate_bps} bit/s")
    return ieee80211b(bit_rate_bps) if reception.model == "802.11b" else ieee80211ag(bit_rate_bps)
