"""Success table: what was measured instead of a formula, frames received by SINR."""

# pyright: basic, reportUnknownMemberType=false

from numba import njit

from swarmwire.comms.air.decibels import to_db


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
