"""Packets of the PHY that are not done, and the transmit statuses that senders get where radios acknowledge.

`PacketTable` keeps the packets beside the rows of dtype PACKET that events work on.
"""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import IntArray
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

NO_ACKNOWLEDGEMENT, RESULT_TOO_LARGE = int(TxResult.NO_ACKNOWLEDGEMENT), int(TxResult.TOO_LARGE)


def final_statuses(packet: Table, tx_status_id: IntArray) -> TxStatuses:
    """Transmit statuses of packets that are done, where requested; senders that died get none."""
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
        """Whether there are packets to forget."""
        return bool(self.table["is_done"].any())

    def add(self, taken: Transmissions, frames: "Frames", robots: int) -> None:
        """Append packets that radios admitted; each arena has `robots` robots."""
        rows, waiting = packet_rows(taken, frames, robots), len(self.table)
        self.queued = self.queued.followed_by(taken)
        if not waiting:
            self.table = rows
            return
        table = np.empty(len(self.queued), PACKET)  # np.concatenate compares each field's type
        table[:waiting], table[waiting:] = self.table, rows
        self.table = table

    def forget_done(self) -> bool:
        """Drop packets that are done, if any; packets with a recorded reception have no intended receivers left."""
        kept, count = _settle(self.table, self.queued.table), len(self.table)
        if not len(kept):
            self.drain()
        elif len(kept) < count:
            self.queued, self.table = self.queued.select(kept), self.table[kept]
        return len(kept) < count

    def drain(self) -> Transmissions:
        """Take out all packets."""
        packets, self.queued, self.table = self.queued, Transmissions.none(), np.zeros(0, PACKET)
        return packets


class Frames(NamedTuple):
    """A radio's frames by the size of their packets, as `size_row` has it."""

    headers_bytes: int
    bits: IntArray
    airtime_ns: IntArray
    pause_ns: IntArray  # interframe space after it


def frames_of(radio: Radio) -> Frames:
    """The frames of a radio."""
    headers_bytes, sizes = frame_sizes(radio)
    pause_ns = np.zeros(len(sizes), np.int64)
    if radio.access_or_default.method == "csma-802154":
        pause_ns = IEEE_802_15_4.ifs_ns(sizes - HEADER_BYTES)
    return Frames(headers_bytes, 8 * sizes, airtime_ns(radio, sizes), pause_ns)


def packet_rows(taken: Transmissions, frames: Frames, robots: int) -> Table:
    """Rows of dtype PACKET for packets that wait at their radios, (k,); `robots` per arena."""
    packet: Table = np.zeros(len(taken), PACKET)
    _fill(packet, taken.table, taken.payloads.offset, robots, *frames)
    return packet


@kernel(from_python=True)
def _fill(packet, taken, offset, robots, headers_bytes, bits, airtime_ns, pause_ns):
    for k in range(len(packet)):
        row, sender, to = packet[k], taken[transmissions.SENDER, k], taken[transmissions.TO, k]
        size = size_row(taken, offset, k, headers_bytes)
        row.sender, row.sequence = sender, taken[transmissions.SEQUENCE, k]
        row.to = to if to in (BROADCAST, NOWHERE) else sender - sender % robots + to
        row.sent_at_ns = row.on_air_at_ns = taken[transmissions.SENT_AT, k]
        row.fate = UNDER_WAY
        if size < len(bits):
            row.bits, row.airtime_ns, row.pause_ns = bits[size], airtime_ns[size], pause_ns[size]
            row.is_too_large, row.result = False, NO_ACKNOWLEDGEMENT
        else:
            row.is_too_large, row.result = True, RESULT_TOO_LARGE


@njit()
def _settle(packet, queued):
    """Mark packets with a recorded reception, in both tables; the rows of those that are not done."""
    kept, count = np.empty(len(packet), np.int64), 0
    for p in range(len(packet)):
        row = packet[p]
        if row.is_settled:
            row.is_departed = 1
            queued[transmissions.INTENDED, p] = 0
        kept[count] = p
        count += row.is_done == 0
    return kept[:count]


@njit()
def links_of_rows(
    queued,
    data,
    offset,
    packet,
    row_packet,
    receiver,
    fate,
    in_range,
    final_at_ns,
    row_on_air_at_ns,
    power_mw,
    rows,
    kept,
):
    """The packets with result rows, or done since: their columns and payloads; and the links of these rows.

    `queued` and its payloads are the table of transmissions, whose packets are the rows of `packet`; then come columns
    of the result rows and their number. `kept` (rows,) are rows with an intended receiver, all if it is empty.

    Of the links it returns the table, as of `Links`, the power, NaN in the row for the rest, and the result rows.
    """
    place, on_air_at_ns = np.full(len(packet), ABSENT), np.empty(len(packet), np.int64)
    for p in range(len(packet)):
        row = packet[p]
        on_air_at_ns[p] = row.on_air_at_ns
        # An addressed packet may have been received in an earlier call, and only now be done at its sender.
        if row.is_done and not row.is_departed:
            place[p] = 0
    links = 0
    for k in range(rows):
        place[row_packet[k]], on_air_at_ns[row_packet[k]] = 0, row_on_air_at_ns[k]
        links += receiver[k] != NO_ROBOT and (len(kept) == 0 or kept[k])
    index, count = np.empty(len(packet), np.int64), 0
    for p in range(len(packet)):
        if place[p] == 0:
            index[count], place[p] = p, count
            count += 1
    index = index[:count]
    packets = np.empty((len(queued), count), np.int64)
    for column in range(len(queued)):
        for k in range(count):
            packets[column, k] = queued[column, index[k]]
    for k in range(count):
        row, at_ns = packet[index[k]], on_air_at_ns[index[k]]
        packets[transmissions.ON_AIR_AT, k], packets[transmissions.FATE, k] = at_ns, row.fate
        packets[transmissions.OFF_AIR_AT, k] = at_ns + (row.airtime_ns if row.fate == UNDER_WAY else 0)
    table, power = np.empty((link.COLUMNS, links + count), np.int64), np.full(links + count, np.nan)
    others, row_of, at = packets[transmissions.INTENDED].copy(), np.empty(links, np.int64), 0
    for k in range(rows):
        if receiver[k] != NO_ROBOT and (len(kept) == 0 or kept[k]):
            p = place[row_packet[k]]
            others[p] -= 1
            table[link.PACKET, at], table[link.SENDER, at] = p, packets[transmissions.SENDER, p]
            table[link.RECEIVER, at], table[link.SEQUENCE, at] = receiver[k], packets[transmissions.SEQUENCE, p]
            table[link.RECEIVERS, at], table[link.IN_RANGE, at] = 1, in_range[k]
            table[link.FATE, at], table[link.FINAL_AT, at] = fate[k], final_at_ns[k]
            power[at], row_of[at] = power_mw[k], k
            at += 1
    fill_remainders(table, links, packets, others)
    selected, starts = transmissions.payload_rows(data, offset, index)
    return packets, selected, starts, table, power, row_of
