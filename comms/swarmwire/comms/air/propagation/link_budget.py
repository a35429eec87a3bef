"""Link budget: from the sender's power to that at the receiver, each step a figure in dB."""

# pyright: basic, reportUnknownMemberType=false

from dataclasses import dataclass

from numba import njit

from swarmwire.comms.parameters import parameter


@dataclass(frozen=True)
class Antenna:
    """What a robot's radio puts on air and takes from it; the same in all directions."""

    power_dbm: float = parameter(0.0, help="transmit power into the antenna", unit="dBm", at_least=-100, at_most=100)
    gain_dbi: float = parameter(
        0.0, help="gain of the antenna, for what it sends and what it hears", unit="dBi", at_least=-100, at_most=100
    )


@njit(cache=True)
def rssi_dbm(power_dbm, sender_gain_dbi, receiver_gain_dbi, loss_db):
    """Received power in dBm: power + both gains - all losses. Reciprocal up to the difference in power."""
    return power_dbm + (sender_gain_dbi + receiver_gain_dbi) - loss_db
