"""Neighbours remembered from their beacons: where each should be by now, in a fixed number of slots a robot."""

from typing import Any

import numpy as np

from swarmwire.agent.fields import Vectors
from swarmwire.agent.vector_agent import FloatColumn, IntColumn, State, column
from swarmwire.comms.arrays import FloatArray, IntArray

SLOTS = 8  # neighbours that a robot remembers
NO_ROBOT = -1  # sender in an empty slot


class Remembered(State):
    """A robot's neighbours, (n, SLOTS); vectors lead from the robot along the axes of the compass.

    An empty slot has the sender NO_ROBOT, and is infinitely old.
    """

    sender: IntColumn = column(NO_ROBOT, width=SLOTS)
    sequence: IntColumn = column(NO_ROBOT, width=SLOTS)  # of the newest packet
    x_m: FloatColumn = column(0.0, width=SLOTS)
    y_m: FloatColumn = column(0.0, width=SLOTS)
    x_mps: FloatColumn = column(0.0, width=SLOTS)  # as its newest packet said
    y_mps: FloatColumn = column(0.0, width=SLOTS)
    age_s: FloatColumn = column(np.inf, width=SLOTS)  # of the newest packet


def known(table: Remembered) -> FloatArray:
    """1 for a slot that is taken, 0 for an empty one, (n, SLOTS)."""
    return np.where(table.sender == NO_ROBOT, 0.0, 1.0)


def pass_time(table: Remembered, own_mps: Vectors, period_s: float) -> None:
    """A period later every neighbour is where its velocity and the robot's own (n,) have brought it."""
    table.x_m += (table.x_mps - own_mps.x[:, None]) * period_s
    table.y_m += (table.y_mps - own_mps.y[:, None]) * period_s
    table.age_s += period_s


def forget(table: Remembered, after_s: float) -> None:
    """Empty the slots whose newest packet is older than `after_s`."""
    old = table.age_s > after_s
    for name, (_, empty, _) in Remembered.columns.items():
        getattr(table, name)[old] = empty


def remember(
    table: Remembered,
    row: IntArray,
    sender: IntArray,
    sequence: IntArray,
    place_m: Vectors,
    velocity_mps: Vectors,
    age_s: FloatArray,
) -> None:
    """Take in what the packets said that the robots `row` received, (k,) each, vectors along the axes of the compass.

    Of each sender the newest packet counts, by its sequence, as one may overtake another; of all senders the SLOTS
    nearest are kept.
    """
    if len(row) == 0:
        return
    new_columns = (sender, sequence, place_m.x, place_m.y, velocity_mps.x, velocity_mps.y, age_s)
    held, slot = np.nonzero(table.sender != NO_ROBOT)
    rows = np.concatenate((held, row))
    both: dict[str, Any] = {
        name: np.concatenate((getattr(table, name)[held, slot], new))
        for name, new in zip(Remembered.columns, new_columns, strict=True)
    }
    kept = _newest(rows, both["sender"], both["sequence"])
    kept, place = _nearest(kept, rows, both["sender"], np.hypot(both["x_m"], both["y_m"]))
    forget(table, -np.inf)
    for name in Remembered.columns:
        getattr(table, name)[rows[kept], place] = both[name][kept]


def _newest(rows: IntArray, sender: IntArray, sequence: IntArray) -> IntArray:
    """Which of all entries is the newest of its row and sender."""
    order = np.lexsort((sequence, sender, rows))
    last = (np.diff(rows[order], append=NO_ROBOT) != 0) | (np.diff(sender[order], append=NO_ROBOT) != 0)
    return order[last]


def _nearest(entries: IntArray, rows: IntArray, sender: IntArray, far_m: FloatArray) -> tuple[IntArray, IntArray]:
    """Which of `entries` are among the SLOTS nearest of their row, and at which place, the nearest at 0."""
    order = entries[np.lexsort((sender[entries], far_m[entries], rows[entries]))]
    place = np.arange(len(order)) - np.searchsorted(rows[order], rows[order])
    return order[place < SLOTS], place[place < SLOTS]
