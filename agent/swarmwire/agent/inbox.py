"""Inbox: the packets that robots received and the tx statuses of those that they sent, as one value."""

from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import IntArray
from swarmwire.comms.base.sentinels import NO_ROBOT
from swarmwire.comms.robot.packets import ReceivedPackets, TxStatuses

NO_ROWS = np.empty(0, np.int64)


class Inbox(NamedTuple):
    """Received packets and tx statuses, in the order of their tables; false if both are empty."""

    received: ReceivedPackets
    tx_status: TxStatuses

    def __bool__(self) -> bool:
        return bool(len(self.received) or len(self.tx_status))

    def followed_by(self, other: "Inbox") -> "Inbox":
        """Return both inboxes joined."""
        return Inbox(
            ReceivedPackets.joined([self.received, other.received]),
            TxStatuses.joined([self.tx_status, other.tx_status]),
        )

    def select(self, rows: IntArray) -> "Inbox":
        """Return the part for these robot rows, (n,), rising."""
        selected, _ = self.split(rows)
        return selected

    def split(self, rows: IntArray) -> "tuple[Inbox, Inbox]":
        """Return the part for these robot rows, (n,), and the part for all others."""
        packets, statuses = np.isin(self.received.receiver, rows), np.isin(self.tx_status.row, rows)
        if packets.all() and statuses.all():
            return self, Inbox(self.received.select(NO_ROWS), self.tx_status.select(NO_ROWS))
        selected, others = (
            Inbox(self.received.select(np.flatnonzero(p)).compacted(), self.tx_status.select(np.flatnonzero(s)))
            for p, s in ((packets, statuses), (~packets, ~statuses))
        )
        return selected, others


def packets_of_rows(received: ReceivedPackets, rows: IntArray) -> ReceivedPackets:
    """Return the packets that the robots `rows` received, with the receiver as an index in `rows`."""
    if not len(received):
        return received
    first, last = (int(rows[0]), int(rows[-1])) if len(rows) else (0, -1)
    min_receiver, max_receiver = int(received.receiver[0]), int(received.receiver[-1])  # receivers rise, as rows do
    if last - first + 1 == len(rows) and first <= min_receiver and max_receiver <= last:
        # One span of rows holds all receivers.
        index = received.receiver - first if len(rows) > 1 else np.zeros(len(received), np.int64)
    else:
        index_of_row = np.full(max(max_receiver, last) + 1, NO_ROBOT)
        index_of_row[rows] = np.arange(len(rows))
        index = index_of_row.take(received.receiver)
        selected = np.flatnonzero(index != NO_ROBOT)
        received, index = received.select(selected), index.take(selected)
    return ReceivedPackets(
        index,
        received.sender_index,
        received.sequence,
        received.received_at_ns,
        received.measured,
        received.payload,
        received.payloads,
    )
