"""Measured links of three robots, and what of them was received."""

from collections.abc import Sequence

import numpy as np

from swarmwire.comms.radio.traces import LinkTrace, Quantity, link_trace
from tests.support.comms.radio.runs import TICK_NS, Run

TRIO = 3
Row = tuple[float, int, int, float]  # tick, sender, receiver, value


def trace_of(quantity: Quantity, rows: Sequence[Row]) -> LinkTrace:
    """The trace of rows (tick, sender, receiver, value)."""
    tick, sender, receiver, value = (np.array(column) for column in zip(*rows, strict=True))
    time_ns = np.round(tick * TICK_NS).astype(np.int64)
    return link_trace(quantity, TRIO, time_ns, sender, receiver, value.astype(np.float64))


def numbers_received(told: Run, sender: int, receiver: int) -> list[int]:
    """The sequence numbers of the packets that the receiver received of the sender."""
    mine = (told.received("sender") == sender) & (told.received("receiver") == receiver)
    return told.received("sequence")[mine].tolist()
