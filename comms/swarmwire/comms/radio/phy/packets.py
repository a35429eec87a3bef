"""Packets of the PHY that are not done, and the transmit statuses that senders get where radios acknowledge.

`PacketTable` has the packets, and rows of dtype PACKET for events.
"""

from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, IntArray
from swarmwire.comms.base.kernels import kernel, njit
from swarmwire.comms.base.sentinels import ABSENT, BROADCAST, NO_ROBOT, NO_TX_STATUS, NOWHERE, UNDER_WAY
from swarmwire.comms.radio import links as link
from swarmwire.comms.radio import transmissions
from swarmwire.comms.radio.config.radio import Radio, airtime_ns
from swarmwire.comms.radio.links import fill_remainders
from swarmwire.comms.radio.phy.state import NO_RESULT, PACKET, Table
from swarmwire.comms.radio.timing import IEEE_802_15_4
from swarmwire.comms.radio.transmissions import Transmissions, frame_sizes, size_row
from swarmwire.comms.robot.packets import NO_TX_STATUSES, Fate, TxResult, TxStatuses

NO_ACKNOWLEDGEMENT, TX_TOO_LARGE = int(TxResult.NO_ACKNOWLEDGEMENT), int(TxResult.TOO_LARGE)


def final_statuses(packet: Table, tx_status_id: IntArray) -> TxStatuses:
    """Return the requested transmit statuses of packets that are done; senders that died get none."""
    if not np.count_nonzero(tx_status_id != NO_TX_STATUS):
        return NO_TX_STATUSES
    is_dead = (packet["fate"] == Fate.SENDER_DEAD) | (packet["result"] == NO_RESULT)
    is_reported = (packet["is_done"] > 0) & (tx_status_id != NO_TX_STATUS) & ~is_dead
    index = np.flatnonzero(is_reported)
    if not len(index):
        return NO_TX_STATUSES
    return TxStatuses(packet["sender"][index], tx_status_id[index], packet["result"][index])


HEADER_BYTES = 6  # IEEE 802.15.4 preamble, delimiter and length, before the PSDU


class PacketTable:
    """The packets that are not done yet.

    Attributes:
        queued: the packets.
        table: their rows, of dtype PACKET.
    """

    def __init__(self) -> None:
        self.queued, self.table = Transmissions.none(), np.zeros(0, PACKET)

    def __len__(self) -> int:
        return len(self.table)

    @property
    def any_done(self) -> bool:
        """True if packets are done, which `forget_done` would remove."""
        return bool(self.table["is_done"].any())

    def add(self, admitted: Transmissions, frames: "Frames", robots: int) -> None:
        """Append packets that radios admitted; each arena has `robots` robots."""
        rows, count = packet_rows(admitted, frames, robots), len(self.table)
        self.queued = self.queued.followed_by(admitted)
        if not count:
            self.table = rows
            return
        table = np.empty(len(self.queued), PACKET)  # faster than np.concatenate, which compares each field's type
        table[:count], table[count:] = self.table, rows
        self.table = table

    def forget_done(self) -> bool:
        """Remove packets that are done, and return True if any was; recorded receptions are no longer intended."""
        unfinished, count = _settle(self.table, self.queued.table), len(self.table)
        if not len(unfinished):
            self.drain()
        elif len(unfinished) < count:
            self.queued, self.table = self.queued.select(unfinished), self.table[unfinished]
        return len(unfinished) < count

    def drain(self) -> Transmissions:
        """Remove and return all packets."""
        packets, self.queued, self.table = self.queued, Transmissions.none(), np.zeros(0, PACKET)
        return packets


class Frames(NamedTuple):
    """Frames of a radio, a row per size of packets, see `size_row`."""

    headers_bytes: int
    bits: IntArray
    airtime_ns: IntArray
    ifs_ns: IntArray  # interframe space after the frame


def frames_of(radio: Radio) -> Frames:
    """Return the frames of a radio."""
    headers_bytes, sizes = frame_sizes(radio)
    ifs_ns = np.zeros(len(sizes), np.int64)
    if radio.access_or_default.method == "csma-802154":
        ifs_ns = IEEE_802_15_4.ifs_ns(sizes - HEADER_BYTES)
    return Frames(headers_bytes, 8 * sizes, airtime_ns(radio, sizes), ifs_ns)


def packet_rows(admitted: Transmissions, frames: Frames, robots: int) -> Table:
    """Return rows of dtype PACKET for packets that wait at their radios, (k,); each arena has `robots` robots."""
    packet: Table = np.zeros(len(admitted), PACKET)
    _fill(packet, admitted.table, admitted.payloads.offset, robots, frames)
    return packet


@kernel(from_python=True)
def _fill(packet: Any, admitted: AnyArray, offset: Any, robots: int, frames: Any):
    for k in range(len(packet)):
        row, sender, to = packet[k], admitted[transmissions.SENDER, k], admitted[transmissions.TO, k]
        size = size_row(admitted, offset, k, frames.headers_bytes)
        row.sender, row.sequence = sender, admitted[transmissions.SEQUENCE, k]
        row.to = to if to in (BROADCAST, NOWHERE) else sender - sender % robots + to
        row.sent_at_ns = row.on_air_at_ns = admitted[transmissions.SENT_AT, k]
        row.fate = UNDER_WAY
        if size < len(frames.bits):
            row.bits, row.airtime_ns, row.ifs_ns = frames.bits[size], frames.airtime_ns[size], frames.ifs_ns[size]
            row.is_too_large, row.result = False, NO_ACKNOWLEDGEMENT
        else:
            row.is_too_large, row.result = True, TX_TOO_LARGE


@njit()
def _settle(packet: Any, queued: AnyArray):
    """Mark packets with a recorded reception, in both tables; return the rows of packets that are not done."""
    unfinished, count = np.empty(len(packet), np.int64), 0
    for p in range(len(packet)):
        row = packet[p]
        if row.is_settled:
            row.is_departed = 1
            queued[transmissions.INTENDED, p] = 0
        unfinished[count] = p
        count += row.is_done == 0
    return unfinished[:count]


@njit()
def links_of_rows(queued: AnyArray, data: Any, offset: Any, packet: Any, rows: Any, is_intended: AnyArray):
    """Return the packets with result rows, or done since, and the links of these rows.

    `queued`, `data` and `offset` are the table and the payloads of the packets, in the order of the rows of `packet`;
    `rows` is a `ResultBuffer`; `is_intended` selects its rows with an intended receiver, all if it is empty.

    Of the packets it returns the table and the payloads' data and offsets; of the links the table as in `Links`, the
    power, NaN in the remainders, and the result rows.
    """
    index_of, on_air_at_ns = np.full(len(packet), ABSENT), np.empty(len(packet), np.int64)
    for p in range(len(packet)):
        row = packet[p]
        on_air_at_ns[p] = row.on_air_at_ns
        # The reception of a unicast packet may have been in earlier results; its sender has finished it only now.
        if row.is_done and not row.is_departed:
            index_of[p] = 0
    links, receiver = 0, rows.receiver
    for k in range(rows.count[0]):
        index_of[rows.packet[k]], on_air_at_ns[rows.packet[k]] = 0, rows.on_air_at_ns[k]
        links += receiver[k] != NO_ROBOT and (len(is_intended) == 0 or is_intended[k])
    selected, count = np.empty(len(packet), np.int64), 0
    for p in range(len(packet)):
        if index_of[p] == 0:
            selected[count], index_of[p] = p, count
            count += 1
    selected = selected[:count]
    packets = np.empty((len(queued), count), np.int64)
    for column in range(len(queued)):
        for k in range(count):
            packets[column, k] = queued[column, selected[k]]
    for k in range(count):
        row, at_ns = packet[selected[k]], on_air_at_ns[selected[k]]
        packets[transmissions.ON_AIR_AT, k], packets[transmissions.FATE, k] = at_ns, row.fate
        packets[transmissions.OFF_AIR_AT, k] = at_ns + (row.airtime_ns if row.fate == UNDER_WAY else 0)
    table, power_mw = np.empty((link.COLUMNS, links + count), np.int64), np.full(links + count, np.nan)
    remaining, row_of, i = packets[transmissions.INTENDED].copy(), np.empty(links, np.int64), 0
    for k in range(rows.count[0]):
        if receiver[k] != NO_ROBOT and (len(is_intended) == 0 or is_intended[k]):
            p = index_of[rows.packet[k]]
            remaining[p] -= 1
            table[link.PACKET, i], table[link.SENDER, i] = p, packets[transmissions.SENDER, p]
            table[link.RECEIVER, i], table[link.SEQUENCE, i] = receiver[k], packets[transmissions.SEQUENCE, p]
            table[link.RECEIVER_COUNT, i], table[link.IN_RANGE, i] = 1, rows.in_range[k]
            table[link.FATE, i], table[link.FINAL_AT, i] = rows.fate[k], rows.final_at_ns[k]
            power_mw[i], row_of[i] = rows.power_mw[k], k
            i += 1
    fill_remainders(table, links, packets, remaining)
    payload_data, payload_offset = transmissions.payload_rows(data, offset, selected)
    return packets, payload_data, payload_offset, table, power_mw, row_of
