"""What the run of events tells: which packets ended, where, and how."""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray


class Told(NamedTuple):
    """What the run of events tells, (capacity,) each: a row per packet and receiver, or per packet never on air."""

    packet: IntArray
    receiver: IntArray  # robot row or NOBODY
    fate: IntArray
    in_range: IntArray
    final_at_ns: IntArray
    hold: IntArray
    on_air_at_ns: IntArray
    power_mw: FloatArray  # at the receiver
    count: IntArray  # (1,) rows told


def room_for(capacity: int) -> Told:
    """Room for so many rows."""
    columns = (np.empty(capacity, np.int64) for _ in range(7))
    return Told._make([*columns, np.empty(capacity), np.zeros(1, np.int64)])


def taken_out(room: Told) -> Told:
    """The rows that were told, out of `room`, which is empty again."""
    count = int(room.count[0])
    rows = Told._make([*(column[:count].copy() for column in room[:-1]), room.count.copy()])
    room.count[0] = 0
    return rows
