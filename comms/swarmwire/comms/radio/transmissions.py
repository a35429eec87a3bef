"""The table of packets at or beyond their sender's radio, and the admission of sent packets to it.

A packet stays in its row from the sender's queue until all its fates are final. The table grows in place, and crosses
into compiled code as three arrays: an argument costs a call from Python as much time as ten rows cost the kernel.
"""

# pyright: basic, reportUnknownMemberType=false

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, BoolArray, ByteArray, IntArray, Table, record_type, writeable
from swarmwire.comms.base.ethernet import FRAME_TAG
from swarmwire.comms.base.kernels import kernel, njit
from swarmwire.comms.base.sentinels import BROADCAST, NO_PACKET, NO_TAG, NO_TX_STATUS, NOWHERE, UNDER_WAY
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.robot.messages import CRTP_TAG
from swarmwire.comms.robot.packets import TAG_BYTES, SentPackets

WAITING, DUE, DECIDED = range(3)  # steps of a packet: in its queue; leaving it; its links are in the table of links
_I, _NS = np.int32, np.int64
# The packets of a sender are in the order in which it sent them. One that ends at its sender's radio never goes on air:
# its times on and off air are the time at which the radio drops it, that is `sent_at_ns` if its queue refuses it.
PACKET = record_type(
    [
        ("sent_at_ns", _NS),  # arrival at the sender's radio
        ("on_air_at_ns", _NS),  # start of the first bit
        ("off_air_at_ns", _NS),  # end of the last bit
        ("sequence", np.int64),  # number of packets that the sender sent before, refused ones included
        ("tx_status_id", np.int64),  # ID of its transmit status, or NO_TX_STATUS
        ("first_byte", np.int64),  # of its payload in `data`; payloads are in the order of the rows, without gaps
        ("sender", _I),  # robot row
        ("to", _I),  # index in the arena of the addressed robot, BROADCAST or NOWHERE
        ("intended", _I),  # number of intended receivers
        # Epoch of `LivenessHistory` when it was sent: a broadcast intends the robots that were alive in it.
        ("epoch", _I),
        ("tag", _I),  # tag of the message's class, or NO_TAG
        ("size_bytes", _I),
        ("fate", np.int8),  # UNDER_WAY if it waits or went on air; else its fate at all intended receivers
        ("step", np.int8),
    ]
)


class Transmissions:
    """A table of packets that grows in place.

    Attributes:
        table: records of type PACKET; rows from `len` on are unused.
        data: their payloads.
        used: number of packets, and of bytes in `data`, (2,).
    """

    __slots__ = ("data", "table", "used")

    def __init__(self) -> None:
        self.table: Table = np.zeros(16, PACKET)
        self.data: ByteArray = np.empty(256, np.uint8)
        self.used: IntArray = np.zeros(2, np.int64)

    def __len__(self) -> int:
        return int(self.used[0])

    @property
    def rows(self) -> Table:
        """The packets, as a view."""
        return self.table[: self.used[0]]

    def reserve(self, packets: int, size_bytes: int) -> None:
        """Make room for more packets and bytes of payload."""
        self.table = grown(self.table, int(self.used[0]), packets)
        self.data = grown(self.data, int(self.used[1]), size_bytes)

    def keep(self, is_kept: BoolArray) -> None:
        """Keep only the packets of `is_kept` (packets,)."""
        keep_packets(self.table, self.data, self.used, is_kept, np.empty(len(is_kept), np.int64))


def grown(table: AnyArray, used: int, more: int) -> AnyArray:
    """Return the table if it has room for `more` rows after those in use, or a copy of twice the length."""
    if used + more <= len(table):
        return table
    larger = np.empty(2 * (used + more), table.dtype)
    larger.view(np.uint8)[: used * table.itemsize] = table.view(np.uint8)[: used * table.itemsize]  # much faster
    return larger


@kernel()
def move_packet(packets, data, row, source, first_byte):
    """Move packet `source` to an earlier or the same row, and its payload to `first_byte`."""
    packet = packets[row]
    from_byte, size_bytes = packets[source].first_byte, packets[source].size_bytes
    if row != source:
        packets[row] = packets[source]
    packet.first_byte = first_byte
    if from_byte != first_byte:
        for i in range(size_bytes):
            data[first_byte + i] = data[from_byte + i]
    return first_byte + size_bytes


@kernel(from_python=True)
def keep_packets(packets, data, used, is_kept, new_row):
    """Keep the packets of `is_kept` (packets,), and write the new row of each to `new_row` (packets,)."""
    row = size = 0
    for p in range(used[0]):
        new_row[p] = row
        if is_kept[p]:
            size = move_packet(packets, data, row, p, size)
            row += 1
    used[0], used[1] = row, size


def first_without_receiver(sent: SentPackets, robots: int) -> int:
    """Return the first packet whose `to` is not another robot of its arena, BROADCAST or NOWHERE; or NO_PACKET."""
    return _first_without_receiver(writeable(sent.sender), writeable(sent.to), robots)


@njit()
def _first_without_receiver(sender, to, robots):
    for k in range(len(to)):
        if lacks_receiver(sender[k], to[k], robots):
            return k
    return NO_PACKET


@kernel()
def lacks_receiver(sender, to, robots):
    """Return True if `to` is not another robot of the sender's arena, BROADCAST or NOWHERE."""
    return to < NOWHERE or to >= robots or to == sender % robots


def frame_sizes(radio: Radio) -> tuple[int, IntArray]:
    """Return the bytes that only frames and CRTP packets save on air, and the bytes on air by `size_row`.

    Of an interface's frame, `overhead_bytes` already counts some headers; the tag of a CRTP packet is not on air.
    """
    headers_bytes = radio.frame_headers_bytes if radio.interface is not None else 0
    if radio.frame == "esb":
        headers_bytes = TAG_BYTES
    return headers_bytes, np.arange(-headers_bytes, radio.max_payload_bytes + 1) + radio.overhead_bytes


@kernel()
def size_row(packet, headers_bytes):
    """Return the row of a packet in `frame_sizes`; beyond its end if the packet is too large."""
    return packet.size_bytes + headers_bytes * (packet.tag not in (FRAME_TAG, CRTP_TAG))


class SentColumns(NamedTuple):
    """Columns of sent packets as input of kernels."""

    sender: IntArray
    to: IntArray
    sent_at_ns: IntArray
    tx_status_id: IntArray  # empty: all NO_TX_STATUS
    data: ByteArray
    offset: IntArray


NO_IDS = np.empty(0, np.int64)
UNSORTED = -6  # `admit` returns it in place of NO_PACKET or a row


class Admission:
    """Appends sent packets to a table of transmissions, and gives each the sequence number of its radio."""

    def __init__(self, rows: int, packets: Transmissions) -> None:
        self._packets, self._sent_before = packets, np.zeros(rows, np.int64)

    def accept(
        self,
        kernel: Callable[..., int],
        sent_at_ns: IntArray,
        sent: SentPackets,
        others_alive: IntArray,
        epoch: int,
        counts: AnyArray,
        params: tuple[Any, ...],
    ) -> int:
        """Append sent packets, sorted by sender, by a `kernel` that calls `admit` and has more `params`.

        Return the first packet without a receiver, and nothing is appended; or NO_PACKET.
        """
        packets, data = self._packets, sent.payloads.data
        packets.reserve(len(sent), len(data))
        columns = SentColumns(
            writeable(sent.sender),
            writeable(sent.to),
            sent_at_ns,
            NO_IDS if sent.tx_status_id is None else writeable(sent.tx_status_id),
            writeable(data),
            writeable(sent.payloads.offset),
        )
        table, used, sent_before = packets.table, packets.used, self._sent_before
        result = kernel(table, packets.data, used, columns, others_alive, epoch, sent_before, counts, *params)
        if result != UNSORTED:
            return result
        # Results must not depend on how the robots are divided among runners.
        order = np.argsort(sent.sender, kind="stable")
        return self.accept(kernel, sent_at_ns[order], sent.select(order), others_alive, epoch, counts, params)


@kernel()
def admit(packets, data, used, sent, others_alive, epoch, sent_before, counts):
    """Append sent packets to the table, with all times at `sent_at_ns`; none is intended for NOWHERE.

    Return NO_PACKET; or the first packet without a receiver, or UNSORTED unless they are sorted by sender, and nothing
    is appended. `others_alive` (rows,) is the number of intended receivers of a robot's broadcasts in this epoch.
    Increments `sent_before` (rows,), and counts the packets in `counts` (arenas,) of type COUNTS.
    """
    robots, is_sorted = len(sent_before) // len(counts), True
    for k in range(len(sent.sender)):
        if lacks_receiver(sent.sender[k], sent.to[k], robots):
            return k
        is_sorted = is_sorted and (k == 0 or sent.sender[k - 1] <= sent.sender[k])
    if not is_sorted:
        return UNSORTED
    for k in range(len(sent.sender)):
        packet, s, to, first = packets[used[0]], sent.sender[k], sent.to[k], sent.offset[k]
        size = sent.offset[k + 1] - first
        packet.sender, packet.to, packet.sequence, packet.epoch = s, to, sent_before[s], epoch
        packet.intended = others_alive[s] if to == BROADCAST else np.int64(to != NOWHERE)
        packet.tag = np.int64(sent.data[first]) | np.int64(sent.data[first + 1]) << 8 if size >= TAG_BYTES else NO_TAG
        packet.tx_status_id = sent.tx_status_id[k] if len(sent.tx_status_id) > 0 else NO_TX_STATUS
        packet.sent_at_ns = packet.on_air_at_ns = packet.off_air_at_ns = sent.sent_at_ns[k]
        packet.fate, packet.step = UNDER_WAY, WAITING
        packet.first_byte, packet.size_bytes = used[1], size
        for i in range(size):
            data[used[1] + i] = sent.data[first + i]
        used[0] += 1
        used[1] += size
        sent_before[s] += 1
        arena = counts[s // robots]
        arena.sent += 1
        arena.intended += packet.intended
    return NO_PACKET
