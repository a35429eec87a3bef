"""The table of packets at or beyond their sender's radio, and the admission of sent packets to the queues.

The columns of a table are one array, and cross into compiled code as one argument: an argument costs a call from
Python as much time as ten rows cost the kernel, and calls take most of the time of a tick of ten robots.
"""

# pyright: basic, reportUnknownMemberType=false

from typing import Protocol

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, ByteArray, IntArray
from swarmwire.comms.base.ethernet import FRAME_TAG
from swarmwire.comms.base.kernels import kernel, njit
from swarmwire.comms.base.sentinels import BROADCAST, NO_PACKET, NO_TAG, NO_TX_STATUS, NOWHERE, UNDER_WAY
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.robot.packets import TAG_BYTES, Payloads, SentPackets

COLUMNS = 11
SENDER, TO, SEQUENCE, INTENDED, EPOCH, TAG, SENT_AT, ON_AIR_AT, OFF_AIR_AT, FATE, TX_STATUS_ID = range(COLUMNS)


class HasTable(Protocol):
    """An object whose columns are the rows of one array."""

    table: IntArray  # (columns, k)


class Column:
    """A named column of a `table`, (k,): a view, which may be written to."""

    def __init__(self, number: int) -> None:
        self._number = number

    def __get__(self, table_owner: HasTable, owner: object = None) -> IntArray:
        return table_owner.table[self._number]


class Transmissions:
    """A row per packet; the packets of a sender are in the order in which it sent them.

    A packet that ends at its sender's radio never goes on air: its times on and off air are the time at which the radio
    drops it, that is `sent_at_ns` if its queue refuses it at once.
    """

    __slots__ = ("payloads", "table")

    sender = Column(SENDER)  # (k,) robot row
    to = Column(TO)  # (k,) index in the arena of the addressed robot, BROADCAST or NOWHERE
    sequence = Column(SEQUENCE)  # (k,) number of packets that the sender sent before, refused ones included
    intended = Column(INTENDED)  # (k,) number of intended receivers
    # (k,) epoch of `LivenessHistory` when it was sent: a broadcast intends the robots that were alive in it
    epoch = Column(EPOCH)
    tag = Column(TAG)  # (k,) tag of the message's class, or NO_TAG
    sent_at_ns = Column(SENT_AT)  # (k,) arrival at the sender's radio
    on_air_at_ns = Column(ON_AIR_AT)  # (k,) start of the first bit
    off_air_at_ns = Column(OFF_AIR_AT)  # (k,) end of the last bit
    fate = Column(FATE)  # (k,) UNDER_WAY if it waits or went on air; else its fate at all intended receivers
    tx_status_id = Column(TX_STATUS_ID)  # (k,) ID of its transmit status, or NO_TX_STATUS

    def __init__(self, table: IntArray, payloads: Payloads) -> None:
        """Use `table` (COLUMNS, k), which holds the columns in their order, and `payloads` of k rows."""
        self.table, self.payloads = table, payloads

    @classmethod
    def none(cls) -> "Transmissions":
        """No packets."""
        return _NONE

    def __len__(self) -> int:
        return self.table.shape[1]

    def select(self, index: IntArray) -> "Transmissions":
        """Return the packets of `index`, in its order."""
        if len(index) == len(self) and (index[1:] > index[:-1]).all():  # all packets, in order
            return self
        payloads = Payloads(*payload_rows(self.payloads.data, self.payloads.offset, index))
        return Transmissions(self.table.take(index, axis=1), payloads)

    def split(self, selected: BoolArray) -> "tuple[Transmissions, Transmissions]":
        """Return the packets `selected` (k,), and the others."""
        count = np.count_nonzero(selected)
        if count == len(self):
            return self, Transmissions.none()
        if not count:
            return Transmissions.none(), self
        first, second = _split(self.table, self.payloads.data, self.payloads.offset, selected)
        return Transmissions(first[0], Payloads(first[1], first[2])), Transmissions(
            second[0], Payloads(second[1], second[2])
        )

    def followed_by(self, later: "Transmissions") -> "Transmissions":
        """Return these packets and then the later ones."""
        if not (len(self) and len(later)):
            return self if len(self) else later
        first, second = self.payloads, later.payloads
        table, data, offset = _append(self.table, first.data, first.offset, later.table, second.data, second.offset)
        return Transmissions(table, Payloads(data, offset))

    def with_columns(self, **columns: IntArray) -> "Transmissions":
        """Return the packets with new values in `columns`."""
        changed = Transmissions(self.table.copy(), self.payloads)
        for name, values in columns.items():
            getattr(changed, name)[:] = values
        return changed


# Payloads that may be written to, as those of kernels.
_NONE = Transmissions(np.empty((COLUMNS, 0), np.int64), Payloads(np.empty(0, np.uint8), np.zeros(1, np.int64)))


@njit()
def payload_rows(data: ByteArray, offset: IntArray, index: IntArray) -> tuple[ByteArray, IntArray]:
    """Return `data` and `offset` of a table of the payloads of `index`, in its order."""
    starts = np.zeros(len(index) + 1, np.int64)
    for k in range(len(index)):
        starts[k + 1] = starts[k] + offset[index[k] + 1] - offset[index[k]]
    selected = np.empty(starts[-1], np.uint8)
    for k in range(len(index)):
        # Byte by byte, since slices count references, which takes longer than to copy the bytes.
        to, row = np.uint64(starts[k]), np.uint64(offset[index[k]])
        for i in range(np.uint64(starts[k + 1]) - to):
            selected[to + i] = data[row + i]
    return selected, starts


@njit()
def _split(table, data, offset, selected):
    """Return columns and payloads of the packets `selected` (k,), and of the others."""
    return _rows(table, data, offset, np.flatnonzero(selected)), _rows(table, data, offset, np.flatnonzero(~selected))


@njit()
def _rows(table, data, offset, index):
    """Return columns and payloads of the packets of `index`."""
    rows = np.empty((len(table), len(index)), np.int64)
    for column in range(len(table)):
        for k in range(len(index)):
            rows[column, k] = table[column, index[k]]
    return rows, *payload_rows(data, offset, index)


@njit()
def _append(table, data, offset, later_table, later_data, later_offset):
    """Return columns and payloads of packets, and then of later ones."""
    first, later, size = table.shape[1], later_table.shape[1], len(data)
    joined = np.empty((len(table), first + later), np.int64)
    joined_data, joined_offset = np.empty(size + len(later_data), np.uint8), np.empty(first + later + 1, np.int64)
    # Number by number, since slices take a second longer to compile.
    for column in range(len(table)):
        for k in range(first):
            joined[column, k] = table[column, k]
        for k in range(later):
            joined[column, first + k] = later_table[column, k]
    for i in range(size):
        joined_data[i] = data[i]
    for i in range(len(later_data)):
        joined_data[size + i] = later_data[i]
    for k in range(first):
        joined_offset[k] = offset[k]
    for k in range(later + 1):
        joined_offset[first + k] = later_offset[k] + offset[first]
    return joined, joined_data, joined_offset


def first_without_receiver(sent: SentPackets, robots: int) -> int:
    """Return the first packet whose `to` is not another robot of its arena, BROADCAST or NOWHERE; or NO_PACKET."""
    return _first_without_receiver(_writeable(sent.sender), _writeable(sent.to), robots)


def _writeable(array: IntArray) -> IntArray:
    """Return the array, or a copy of a read-only one from the wire.

    A kernel would be compiled once more for read-only arrays.
    """
    return array if array.flags.writeable else array.copy()


@njit()
def _first_without_receiver(sender, to, robots):
    for p in range(len(to)):
        if to[p] < NOWHERE or to[p] >= robots or to[p] == sender[p] % robots:
            return p
    return NO_PACKET


def frame_sizes(radio: Radio) -> tuple[int, IntArray]:
    """Return the bytes of an interface's headers within `overhead_bytes`, and the bytes on air by `size_row`."""
    headers_bytes = radio.frame_headers_bytes if radio.interface is not None else 0
    return headers_bytes, np.arange(-headers_bytes, radio.max_payload_bytes + 1) + radio.overhead_bytes


@kernel()
def size_row(packets, offset, p, headers_bytes):
    """Return the row of packet `p` of a table in `frame_sizes`; beyond its end if the packet is too large."""
    return offset[p + 1] - offset[p] + headers_bytes * (packets[TAG, p] != FRAME_TAG)


class Admission:
    """Turns sent packets into transmissions, and gives each the sequence number of its radio."""

    def __init__(self, rows: int) -> None:
        self._sent_before = np.zeros(rows, np.int64)

    def admit(self, sent_at_ns: IntArray, sent: SentPackets, others_alive: IntArray, epoch: int) -> Transmissions:
        """Return the packets sorted by sender, with all times at `sent_at_ns` (k,); none is intended for NOWHERE.

        `others_alive` (rows,) is the number of intended receivers of a robot's broadcasts in this epoch.
        """
        # Results must not depend on how the robots are divided among runners.
        if len(sent) > 1 and (sent.sender[1:] < sent.sender[:-1]).any():
            order = np.argsort(sent.sender, kind="stable")
            sent, sent_at_ns = sent.select(order), sent_at_ns[order]
        payloads = Payloads(sent.payloads.data.copy(), sent.payloads.offset.copy())  # the table shares them
        table = np.empty((COLUMNS, len(sent)), np.int64)
        table[SENDER], table[TO], table[SENT_AT] = sent.sender, sent.to, sent_at_ns
        table[TX_STATUS_ID] = NO_TX_STATUS if sent.tx_status_id is None else sent.tx_status_id
        _admit(table, payloads.data, payloads.offset, others_alive, epoch, self._sent_before)
        return Transmissions(table, payloads)


@kernel(from_python=True)
def _admit(table, data, offset, others_alive, epoch, sent_before):
    """Fill in the other columns of the packets; increments `sent_before` (rows,)."""
    for p in range(table.shape[1]):
        s, to, sent_at_ns, first = table[SENDER, p], table[TO, p], table[SENT_AT, p], offset[p]
        has_tag = offset[p + 1] - first >= TAG_BYTES
        table[TAG, p] = np.int64(data[first]) | np.int64(data[first + 1]) << 8 if has_tag else NO_TAG
        table[INTENDED, p] = others_alive[s] if to == BROADCAST else np.int64(to != NOWHERE)
        table[SEQUENCE, p], table[EPOCH, p], table[FATE, p] = sent_before[s], epoch, UNDER_WAY
        table[ON_AIR_AT, p] = table[OFF_AIR_AT, p] = sent_at_ns
        sent_before[s] += 1
