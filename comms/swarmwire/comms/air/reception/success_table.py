"""Success table: what was measured instead of a formula, frames received by SINR."""

# pyright: basic, reportUnknownMemberType=false

from dataclasses import dataclass
from itertools import pairwise

from numba import njit

from swarmwire.comms.air.decibels import to_db
from swarmwire.comms.errors import BadInput
from swarmwire.comms.parameters import parameter


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


@njit(cache=True)
def table_success(sinr_db, success, frame_bits, sinr, bits):
    """The probability that so many bits arrive right: success^(bits / frame_bits), so that chunks of a frame multiply.

    `sinr_db` and `success` (rows,) are the table's, `sinr` a ratio.
    """
    at_db = to_db(sinr)
    last = len(sinr_db) - 1
    if at_db <= sinr_db[0]:
        whole = success[0]
    elif at_db >= sinr_db[last]:
        whole = success[last]
    else:
        i = 0
        while sinr_db[i + 1] < at_db:
            i += 1
        share = (at_db - sinr_db[i]) / (sinr_db[i + 1] - sinr_db[i])
        whole = success[i] + share * (success[i + 1] - success[i])
    return 1.0 if bits <= 0.0 else whole ** (bits / frame_bits)
