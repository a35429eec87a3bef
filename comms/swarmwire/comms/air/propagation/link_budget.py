"""Link budget: from the sender's power to that at the receiver, each step a figure in dB."""

# pyright: basic, reportUnknownMemberType=false

from numba import njit


@njit(cache=True)
def rssi_dbm(power_dbm, sender_gain_dbi, receiver_gain_dbi, loss_db):
    """Received power in dBm: power + both gains - all losses. Reciprocal up to the difference in power."""
    return power_dbm + (sender_gain_dbi + receiver_gain_dbi) - loss_db
