"""Sensitivity: the least power at which frames get through, derived from the receiver's model and its noise."""

# pyright: basic, reportUnknownMemberType=false

from swarmwire.comms.air.decibels import from_db
from swarmwire.comms.air.reception.receiver import Receiver, chunk_success

LEAST_DB, MOST_DB = -60.0, 100.0
HALVINGS = 60


def sinr_for_db(receiver: Receiver, success: float, bits: int) -> float:
    """The SINR in dB from which a frame of so many bits is right with probability `success`; by bisection.

    `LEAST_DB` if it is so everywhere, `MOST_DB` if nowhere.
    """
    low, high = LEAST_DB, MOST_DB
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if chunk_success(receiver, from_db(middle), bits) >= success:
            high = middle
        else:
            low = middle
    return high


def sensitivity_dbm(receiver: Receiver, noise_dbm: float, success: float, bits: int) -> float:
    """The power in dBm at which, without interference, a frame of so many bits is right with probability `success`.

    Data sheets of IEEE 802.15.4 state it for 99 % of frames with a PSDU of 20 octets, of 802.11b for 92 % of 1024, of
    802.11a/g for 90 % of 1000.
    """
    return noise_dbm + sinr_for_db(receiver, success, bits)
