"""The table of packets at or beyond their sender's radio, and the admission of sent packets to the queues.

The columns of a table are one array, and cross into compiled code as one argument: an argument costs a call from
Python as much as some ten rows cost the kernel, and a tick of ten robots is mostly calls.
"""

# pyright: basic, reportUnknownMemberType=false

from typing import Protocol

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, ByteArray, IntArray
from swarmwire.comms.base.ethernet import FRAME_TAG
from swarmwire.comms.base.kernels import kernel, njit
from swarmwire.comms.base.sentinels import BROADCAST, NO_PACKET, NO_TAG, NOWHERE, UNDER_WAY
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.robot.packets import TAG_BYTES, Payloads, SentPackets

COLUMNS = 11
SENDER, TO, SEQUENCE, INTENDED, EPOCH, TAG, SENT_AT, ON_AIR_AT, OFF_AIR_AT, FATE, TX_STATUS_ID = range(COLUMNS)


class HasTable(Protocol):
    """An object whose columns are the rows of one array."""

    table: IntArray  # (columns, k)


class Column:
    """A named column of a `table`, (k,): a view, which may be written to."""

    def __init__(self, place: int) -> None:
        self._place = place

    def __get__(self, of: HasTable, owner: object = None) -> IntArray:
        return of.table[self._place]


class Transmissions:
    """A row per packet, those of one sender in the order in which it sent them.

    A packet refused by its sender's radio never goes on air: all three of its times are `sent_at_ns`.
    """

    __slots__ = ("payloads", "table")

    sender = Column(SENDER)  # (k,) robot row
    to = Column(TO)  # (k,) index in the arena of the one receiver, BROADCAST or NOWHERE
    sequence = Column(SEQUENCE)  # (k,) number of packets that the sender sent before, refused ones included
    intended = Column(INTENDED)  # (k,) number of intended receivers
    # (k,) epoch of `LivenessHistory` when it was sent: a broadcast intends the robots alive then
    epoch = Column(EPOCH)
    tag = Column(TAG)  # (k,) the message's class, as a tag on the wire
    sent_at_ns = Column(SENT_AT)  # (k,) arrival at the sender's radio
    on_air_at_ns = Column(ON_AIR_AT)  # (k,) start of the first bit
    off_air_at_ns = Column(OFF_AIR_AT)  # (k,) end of the last bit
    fate = Column(FATE)  # (k,) UNDER_WAY: each receiver has a fate of its own; else the fate at all of them
    tx_status_id = Column(TX_STATUS_ID)  # (k,) ID of the transmit status for the sender, or NO_TX_STATUS

    def __init__(self, table: IntArray, payloads: Payloads) -> None:
        """`table` (COLUMNS, k) holds the columns in their order, `payloads` has k rows."""
        self.table, self.payloads = table, payloads

    @classmethod
    def none(cls) -> "Transmissions":
        """No packets."""
        return _NONE

    def __len__(self) -> int:
        return self.table.shape[1]

    def select(self, index: IntArray) -> "Transmissions":
        """The packets of `index`, in its order."""
        if len(index) == len(self) and (index[1:] > index[:-1]).all():  # all of them, in order
            return self
        payloads = Payloads(*payload_rows(self.payloads.data, self.payloads.offset, index))
        return Transmissions(self.table.take(index, axis=1), payloads)

    def parted(self, which: BoolArray) -> "tuple[Transmissions, Transmissions]":
        """The packets `which` (k,), and the others."""
        count = np.count_nonzero(which)
        if count == len(self):
            return self, Transmissions.none()
        if not count:
            return Transmissions.none(), self
        parts = _part(self.table, self.payloads.data, self.payloads.offset, which)
        rows, data, offset, others, data_of_others, offset_of_others = parts
        return Transmissions(rows, Payloads(data, offset)), Transmissions(
            others, Payloads(data_of_others, offset_of_others)
        )

    def followed_by(self, later: "Transmissions") -> "Transmissions":
        """These packets and then the later ones."""
        if not (len(self) and len(later)):
            return self if len(self) else later
        first, second = self.payloads, later.payloads
        parts = self.table, first.data, first.offset, later.table, second.data, second.offset
        table, data, offset = _append(*parts)
        return Transmissions(table, Payloads(data, offset))

    def replaced(self, **columns: IntArray) -> "Transmissions":
        """The packets with other values in some columns."""
        changed = Transmissions(self.table.copy(), self.payloads)
        for name, values in columns.items():
            getattr(changed, name)[:] = values
        return changed


# Payloads that may be written to, as those of kernels.
_NONE = Transmissions(np.empty((COLUMNS, 0), np.int64), Payloads(np.empty(0, np.uint8), np.zeros(1, np.int64)))


@njit()
def payload_rows(data: ByteArray, offset: IntArray, index: IntArray) -> tuple[ByteArray, IntArray]:
    """`data` and `offset` of a table of the payloads of `index`, in its order."""
    starts = np.zeros(len(index) + 1, np.int64)
    for k in range(len(index)):
        starts[k + 1] = starts[k] + offset[index[k] + 1] - offset[index[k]]
    selected = np.empty(starts[-1], np.uint8)
    for k in range(len(index)):
        # Byte by byte: slices count references, which costs more than the bytes.
        to, row = np.uint64(starts[k]), np.uint64(offset[index[k]])
        for i in range(np.uint64(starts[k + 1]) - to):
            selected[to + i] = data[row + i]
    return selected, starts


@njit()
def _part(table, data, offset, which):
    """Columns and payloads of the packets `which` (k,), and of the others."""
    rows, others = np.flatnonzero(which), np.flatnonzero(~which)
    one, other = np.empty((len(table), len(rows)), np.int64), np.empty((len(table), len(others)), np.int64)
    for column in range(len(table)):
        for k in range(len(rows)):
            one[column, k] = table[column, rows[k]]
        for k in range(len(others)):
            other[column, k] = table[column, others[k]]
    data_of_one, offset_of_one = payload_rows(data, offset, rows)
    data_of_other, offset_of_other = payload_rows(data, offset, others)
    return one, data_of_one, offset_of_one, other, data_of_other, offset_of_other


@njit()
def _append(table, data, offset, later_table, later_data, later_offset):
    """Columns and payloads of packets, and then of later ones."""
    first, later, size = table.shape[1], later_table.shape[1], len(data)
    joined = np.empty((len(table), first + later), np.int64)
    joined_data, joined_offset = np.empty(size + len(later_data), np.uint8), np.empty(first + later + 1, np.int64)
    # Number by number: assigning slices takes a second longer to compile.
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
    """The first packet whose `to` is not another robot of its arena, BROADCAST or NOWHERE; or NO_PACKET."""
    return _first_without_receiver(_writeable(sent.sender), _writeable(sent.to), robots)


def _writeable(array: IntArray) -> IntArray:
    """The array, or a copy: those from the wire are read-only, and a kernel would be compiled once more for these."""
    return array if array.flags.writeable else array.copy()


@njit()
def _first_without_receiver(sender, to, robots):
    for p in range(len(to)):
        if to[p] < NOWHERE or to[p] >= robots or to[p] == sender[p] % robots:
            return p
    return NO_PACKET


def frame_sizes(radio: Radio) -> tuple[int, IntArray]:
    """Headers in bytes of an interface's frame that `overhead_bytes` holds already; and bytes on air by `size_row`."""
    headers_bytes = radio.frame_headers_bytes if radio.interface is not None else 0
    return headers_bytes, np.arange(-headers_bytes, radio.max_payload_bytes + 1) + radio.overhead_bytes


@kernel()
def size_row(packets, offset, p, headers_bytes):
    """The place of packet `p` of a table in `frame_sizes`; beyond its end if the packet is too large."""
    return offset[p + 1] - offset[p] + headers_bytes * (packets[TAG, p] != FRAME_TAG)


class Admission:
    """Numbers sent packets and turns them into transmissions; counts the packets of each radio."""

    def __init__(self, rows: int) -> None:
        self._sent_before = np.zeros(rows, np.int64)

    def take(self, sent_at_ns: IntArray, sent: SentPackets, others_alive: IntArray, epoch: int) -> Transmissions:
        """The packets sorted by sender, with all times at `sent_at_ns` (k,); those to NOWHERE intend no receiver.

        `others_alive` (rows,) is the number of intended receivers of a robot's broadcasts in this epoch.
        """
        if (
            len(sent) > 1 and (sent.sender[1:] < sent.sender[:-1]).any()
        ):  # results must not depend on how the backend was divided
            order = np.argsort(sent.sender, kind="stable")
            sent, sent_at_ns = sent.select(order), sent_at_ns[order]
        columns = _writeable(sent.sender), _writeable(sent.to), _writeable(sent.tx_status_ids)
        data, offset = sent.payloads.data.copy(), sent.payloads.offset.copy()  # the table keeps them
        columns = *columns, data, offset, _writeable(sent_at_ns), others_alive
        table = _admit(*columns, epoch, self._sent_before)
        return Transmissions(table, Payloads(data, offset))


@njit()
def _admit(sender, to, tx_status_id, data, offset, sent_at_ns, others_alive, epoch, sent_before):
    """The columns of the packets; increments `sent_before` (rows,)."""
    table = np.empty((COLUMNS, len(sender)), np.int64)
    for p in range(len(sender)):
        s = sender[p]
        at, has_tag = offset[p], offset[p + 1] - offset[p] >= TAG_BYTES
        tag = np.int64(data[at]) | np.int64(data[at + 1]) << 8 if has_tag else NO_TAG
        intended, at_ns = others_alive[s] if to[p] == BROADCAST else np.int64(to[p] != NOWHERE), sent_at_ns[p]
        row = (s, to[p], sent_before[s], intended, epoch, tag, at_ns, at_ns, at_ns, UNDER_WAY, tx_status_id[p])
        for column in range(len(row)):
            table[column, p] = row[column]
        sent_before[s] += 1
    return table
