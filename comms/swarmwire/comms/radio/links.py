"""The table of links, a row per packet and receiver, which all stages of the channel read and write."""

from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, FloatArray, IntArray
from swarmwire.comms.base.kernels import kernel, njit
from swarmwire.comms.base.sentinels import ABSENT, NO_ROBOT, UNDER_WAY
from swarmwire.comms.radio import transmissions
from swarmwire.comms.radio.transmissions import Column, Transmissions
from swarmwire.comms.robot.packets import Fate, Payloads

RECEIVED, OUT_OF_RANGE = int(Fate.RECEIVED), int(Fate.OUT_OF_RANGE)

COLUMNS = 8
PACKET, SENDER, RECEIVER, SEQUENCE, RECEIVER_COUNT, IN_RANGE, FATE, FINAL_AT = range(COLUMNS)


class LinkColumns(NamedTuple):
    """Columns of `Links` as input of kernels, (k,) each."""

    sender: IntArray
    receiver: IntArray
    sequence: IntArray
    fate: IntArray


class Links:
    """A row per packet and possible receiver, and one row per packet for its remaining intended receivers.

    The row for the remainder (receiver NO_ROBOT) is a count without receivers: those out of range, by subtraction, or
    all of them if the packet ended at the sender's radio. Stages never see it. A link is UNDER_WAY until a stage
    decides its fate; all links that leave a radio model have one.

    Attributes:
        table: (COLUMNS, k) the columns of whole numbers.
        rssi_dbm: (k,) power at the receiver; NaN in a unit disk, and in rows for the remainder.
        measured: (k, columns) measurements at the receiver, in the order of the radio's `measures.columns`.
    """

    __slots__ = ("measured", "rssi_dbm", "table")

    packet = Column(PACKET)  # (k,) row in the table of transmissions
    sender = Column(SENDER)  # (k,) robot row
    receiver = Column(RECEIVER)  # (k,) robot row, or NO_ROBOT in a row for the remainder
    sequence = Column(SEQUENCE)  # (k,) sequence number of the packet
    receiver_count = Column(RECEIVER_COUNT)  # (k,) number of intended receivers of the row
    in_range = Column(IN_RANGE)  # (k,) number of them in range, as beside `Fate` in `robot/packets.py`
    fate = Column(FATE)  # (k,) a Fate, or UNDER_WAY
    final_at_ns = Column(FINAL_AT)  # (k,) time at which the fate becomes final

    def __init__(self, table: IntArray, rssi_dbm: FloatArray, measured: FloatArray) -> None:
        self.table, self.rssi_dbm, self.measured = table, rssi_dbm, measured

    @classmethod
    def under_way(
        cls,
        packet: IntArray,
        sender: IntArray,
        receiver: IntArray,
        sequence: IntArray,
        final_at_ns: IntArray,
        columns: int,
    ) -> "Links":
        """Return links that are UNDER_WAY, as input of the first stage."""
        k = len(packet)
        count = np.ones(k, np.int64)
        table = np.stack([packet, sender, receiver, sequence, count, count, np.full(k, UNDER_WAY), final_at_ns])
        return cls(table, np.full(k, np.nan), np.zeros((k, columns)))

    @classmethod
    def with_remainders(
        cls, packets: Transmissions, packet: IntArray, receiver: IntArray, in_range: IntArray, columns: int
    ) -> "Links":
        """Return the links of packets that go on air, UNDER_WAY, then the row of each packet for the remainder.

        `packet` and `receiver` are columns of the links. `in_range` (packets,) is the number of receivers in range of a
        packet that never goes on air, else 0.
        """
        return cls(*_with_remainders(packet, receiver, packets.table, in_range, columns))

    @classmethod
    def none(cls, columns: int) -> "Links":
        """No links."""
        return cls(np.empty((COLUMNS, 0), np.int64), np.empty(0), np.empty((0, columns)))

    def __len__(self) -> int:
        return self.table.shape[1]

    @property
    def columns(self) -> LinkColumns:
        """Views of columns, as input of kernels."""
        return LinkColumns(self.sender, self.receiver, self.sequence, self.fate)

    def select(self, index: IntArray) -> "Links":
        """Return the rows of `index`, in its order."""
        return Links(self.table.take(index, axis=1), self.rssi_dbm.take(index), self.measured.take(index, axis=0))

    def first(self, rows: int) -> "Links":
        """Return the first `rows` rows, as views."""
        return Links(self.table[:, :rows], self.rssi_dbm[:rows], self.measured[:rows])


@njit()
def _with_remainders(packet: AnyArray, receiver: AnyArray, packets: AnyArray, in_range: AnyArray, columns: Any):
    """Return the tables of `Links` for a table of `Transmissions`, links + packets rows each."""
    sender, sequence = packets[transmissions.SENDER], packets[transmissions.SEQUENCE]
    off_air_at_ns = packets[transmissions.OFF_AIR_AT]
    links, count = len(packet), len(sender)
    table = np.empty((COLUMNS, links + count), np.int64)
    remaining = packets[transmissions.INTENDED].copy()
    for row in range(links):
        p = packet[row]
        remaining[p] -= 1
        table[PACKET, row], table[SENDER, row], table[RECEIVER, row] = p, sender[p], receiver[row]
        table[SEQUENCE, row], table[RECEIVER_COUNT, row], table[IN_RANGE, row] = sequence[p], 1, 1
        table[FATE, row], table[FINAL_AT, row] = UNDER_WAY, off_air_at_ns[p]
    fill_remainders(table, links, packets, remaining)
    for p in range(count):
        table[IN_RANGE, links + p] = in_range[p]
    rows = links + count
    return table, np.full(rows, np.nan), np.zeros((rows, columns))


@kernel()
def fill_remainders(table: AnyArray, first: int, packets: AnyArray, remaining: AnyArray):
    """Fill in the rows of `packets` for the remainder, from row `first` on; `remaining` (packets,) counts receivers."""
    for p in range(len(remaining)):
        row, fate = first + p, packets[transmissions.FATE, p]
        table[PACKET, row], table[SENDER, row], table[RECEIVER, row] = p, packets[transmissions.SENDER, p], NO_ROBOT
        table[SEQUENCE, row] = packets[transmissions.SEQUENCE, p]
        table[RECEIVER_COUNT, row], table[IN_RANGE, row] = remaining[p], 0
        table[FATE, row] = OUT_OF_RANGE if fate == UNDER_WAY else fate
        table[FINAL_AT, row] = packets[transmissions.OFF_AIR_AT, p]


class OpenLinks:
    """Links whose fate is not final yet, and their packets.

    The tables have spare rows, since sub-ticks add many small parts.

    Attributes:
        link_count, packet_count: number of links, and of packets.
        table, rssi_dbm, measured: tables of `Links`; rows from `link_count` on are unused.
        packet_table, data, offset: tables of the packets and their payloads; rows from `packet_count` on are unused.
    """

    __slots__ = ("data", "link_count", "measured", "offset", "packet_count", "packet_table", "rssi_dbm", "table")

    def __init__(self, packets: Transmissions, links: Links) -> None:
        self._set_tables(packets, links)

    @property
    def links(self) -> Links:
        """The links, as views."""
        count = self.link_count
        return Links(self.table[:, :count], self.rssi_dbm[:count], self.measured[:count])

    @property
    def transmissions(self) -> Transmissions:
        """The packets, as views."""
        offset = self.offset[: self.packet_count + 1]
        return Transmissions(self.packet_table[:, : self.packet_count], Payloads(self.data[: offset[-1]], offset))

    def add(self, packets: Transmissions, links: Links) -> None:
        """Append packets and their links, whose `packet` is the row in `packets`."""
        if not self.packet_count:
            self._set_tables(packets, links)
            return
        payloads = packets.payloads
        rows, count, size = self.link_count + len(links), self.packet_count + len(packets), len(payloads.data)
        payload_bytes = int(self.offset[self.packet_count]) + size
        if rows > len(self.rssi_dbm) or count >= len(self.offset) or payload_bytes > len(self.data):
            # New tables instead of larger ones in place, since results share the payloads.
            self._grow(self.links, self.transmissions, 2 * rows, 2 * count, 2 * payload_bytes)
        new = links.table, links.rssi_dbm, links.measured, packets.table, payloads.data, payloads.offset
        old = self.table, self.rssi_dbm, self.measured, self.packet_table, self.data, self.offset
        _append(self.link_count, self.packet_count, *old, *new)
        self.link_count, self.packet_count = rows, count

    def keep(self, index: IntArray) -> None:
        """Keep only the links of `index`, in its order, and their packets."""
        links, packets = self.links.select(index), self.transmissions
        used, links.packet[:] = renumbered(links.packet, len(packets))
        self._set_tables(packets.select(used), links)

    def _set_tables(self, packets: Transmissions, links: Links) -> None:
        self.link_count, self.table = len(links), links.table
        self.rssi_dbm, self.measured = links.rssi_dbm, links.measured
        # Contiguous, since a kernel would be compiled once more for views.
        self.packet_count, self.packet_table = len(packets), np.ascontiguousarray(packets.table)
        self.data, self.offset = packets.payloads.data, packets.payloads.offset

    def _grow(self, links: Links, packets: Transmissions, rows: int, count: int, size: int) -> None:
        """Copy `links` and `packets` to tables of `rows` links, `count` packets and `size` bytes."""
        self.table, self.rssi_dbm = np.empty((COLUMNS, rows), np.int64), np.empty(rows)
        self.measured = np.empty((rows, links.measured.shape[1]))
        self.packet_table, self.data = np.empty((transmissions.COLUMNS, count), np.int64), np.empty(size, np.uint8)
        self.offset = np.empty(count + 1, np.int64)
        self.table[:, : len(links)], self.rssi_dbm[: len(links)] = links.table, links.rssi_dbm
        self.measured[: len(links)], self.packet_table[:, : len(packets)] = links.measured, packets.table
        self.data[: len(packets.payloads.data)], self.offset[: len(packets) + 1] = (
            packets.payloads.data,
            packets.payloads.offset,
        )


@njit()
def _append(
    link_count: Any,
    packet_count: Any,
    table: AnyArray,
    rssi_dbm: AnyArray,
    measured: AnyArray,
    packet_table: AnyArray,
    data: AnyArray,
    offset: AnyArray,
    new_table: AnyArray,
    new_rssi_dbm: AnyArray,
    new_measured: AnyArray,
    new_packet_table: AnyArray,
    new_data: AnyArray,
    new_offset: AnyArray,
):
    """Write new rows after the `link_count` and `packet_count` rows in use."""
    for k in range(new_table.shape[1]):
        row = link_count + k
        for column in range(len(table)):
            table[column, row] = new_table[column, k]
        table[PACKET, row] += packet_count
        rssi_dbm[row] = new_rssi_dbm[k]
        for column in range(measured.shape[1]):
            measured[row, column] = new_measured[k, column]
    size = offset[packet_count]
    for k in range(new_packet_table.shape[1]):
        for column in range(len(packet_table)):
            packet_table[column, packet_count + k] = new_packet_table[column, k]
        offset[packet_count + k + 1] = size + new_offset[k + 1]
    for k in range(len(new_data)):
        data[size + k] = new_data[k]


@njit()
def renumbered(index: IntArray, rows: int) -> tuple[IntArray, IntArray]:
    """Return the distinct rows in `index` out of `rows`, rising, and `index` renumbered to refer to these."""
    position, used = np.full(rows, ABSENT), np.empty(rows, np.int64)
    for row in index:
        position[row] = 0
    count = 0
    for row in range(rows):
        if position[row] == 0:
            used[count], position[row] = row, count
            count += 1
    return used[:count], position[index]
