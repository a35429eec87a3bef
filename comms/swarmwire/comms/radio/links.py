"""The table of links, a row per packet and receiver: written by a radio model, read until its fate is final."""

# pyright: basic, reportUnknownMemberType=false

from typing import Any

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, BoolArray, IntArray, Table, record_type
from swarmwire.comms.base.kernels import kernel, njit
from swarmwire.comms.base.sentinels import NO_ROBOT, UNDER_WAY
from swarmwire.comms.radio.transmissions import WAITING, Transmissions, grown, keep_packets
from swarmwire.comms.robot.packets import Fate

RECEIVED, OUT_OF_RANGE = int(Fate.RECEIVED), int(Fate.OUT_OF_RANGE)

_I, _F = np.int32, np.float64
# A row fits into one cache line.
LINK = record_type(
    [
        ("final_at_ns", np.int64),  # time at which the fate becomes final
        ("rssi_dbm", _F),  # power at the receiver; NaN in a unit disk, and in rows for the remainder
        ("range_m", _F),  # measurements of the receiver, each only if its radio measures it
        ("bearing_rad", _F),
        ("measured_rssi_dbm", _F),
        ("packet", _I),  # row in the table of transmissions
        ("sender", _I),  # robot row
        ("receiver", _I),  # robot row, or NO_ROBOT in a row for the remainder
        ("receiver_count", _I),  # number of intended receivers of the row
        ("in_range", _I),  # number of them in range, as beside `Fate` in `robot/packets.py`
        ("fate", np.int8),  # a Fate
    ]
)


class Links:
    """A row per packet and possible receiver, and one row per packet for its remaining intended receivers.

    The row for the remainder (receiver NO_ROBOT) is a count without receivers: those out of range, by subtraction, or
    all of them if the packet ended at the sender's radio. The table grows in place.

    Attributes:
        table: records of type LINK; rows from `len` on are unused.
        used: number of links, (1,).
    """

    __slots__ = ("table", "used")

    def __init__(self) -> None:
        self.table: Table = np.zeros(16, LINK)
        self.used: IntArray = np.zeros(1, np.int64)

    def __len__(self) -> int:
        return int(self.used[0])

    @property
    def rows(self) -> Table:
        """The links, as a view."""
        return self.table[: self.used[0]]

    def reserve(self, links: int) -> None:
        """Make room for more links."""
        self.table = grown(self.table, int(self.used[0]), links)

    def keep(self, is_kept: BoolArray, packets: Transmissions) -> None:
        """Keep only the links of `is_kept` (links,), and the packets that have any or wait in their queue."""
        keep_links(self.table, self.used, is_kept, packets.table, packets.data, packets.used)


@njit(nogil=True)
def keep_links(links, link_used, is_kept, packets, data, used):
    """Keep the links of `is_kept` (links,), and the packets that have any or wait in their queue."""
    has_links, new_row = np.empty(used[0], np.bool_), np.empty(used[0], np.int64)
    for p in range(used[0]):
        has_links[p] = packets[p].step == WAITING
    row = np.uint64(0)
    for i in range(np.uint64(link_used[0])):
        if is_kept[i]:
            has_links[links[i].packet] = True
            if row != i:
                links[row] = links[i]
            row += np.uint64(1)
    link_used[0] = row
    keep_packets(packets, data, used, has_links, new_row)
    for i in range(link_used[0]):
        links[i].packet = new_row[links[i].packet]


@kernel()
def fill_remainder(link, packet, p, remaining, in_range):
    """Fill in the row for the `remaining` receivers of packet `p`, `in_range` of them in range."""
    link.packet, link.sender, link.receiver, link.receiver_count, link.in_range = (
        p,
        packet.sender,
        NO_ROBOT,
        remaining,
        in_range,
    )
    link.fate = OUT_OF_RANGE if packet.fate == UNDER_WAY else packet.fate
    link.final_at_ns, link.rssi_dbm = packet.off_air_at_ns, np.nan


def keep_link_order(packets: Table, links: Table, first: int, rows: int) -> None:
    """Delay rows of `links` from `first` on so that packets of one link arrive in the order in which they were sent.

    In place. The links of the medium contain all receptions still to come, so no further state is needed. A
    reception ended by a disruption delays nothing. `rows` is the number of robots of all arenas; rows before `first`
    have been delayed already, and do not change.
    """
    received = np.flatnonzero((links["fate"] == RECEIVED) & (links["receiver"] != NO_ROBOT))
    link = links["sender"][received].astype(np.int64) * rows + links["receiver"][received]
    # Sequence numbers of a sender rise in the order of time on air.
    order = received[np.lexsort((packets["sequence"][links["packet"][received]], link))]
    _delay(links, order, first)


@njit()
def _delay(links: Any, order: AnyArray, first: int):
    for i in range(1, len(order)):
        previous, link = links[order[i - 1]], links[order[i]]
        if order[i] >= first and link.sender == previous.sender and link.receiver == previous.receiver:
            link.final_at_ns = max(link.final_at_ns, previous.final_at_ns)
