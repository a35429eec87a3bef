"""Packets of the PHY that are not done, and the transmit statuses that senders get where radios acknowledge.

`PacketTable` has the packets, and rows of dtype PACKET for events.
"""

from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, IntArray, Table
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.base.sentinels import ABSENT, BROADCAST, NO_PACKET, NO_ROBOT, NO_TX_STATUS, NOWHERE, UNDER_WAY
from swarmwire.comms.radio.config.frames import airtime_ns, broadcast_airtime_ns, frame_bits
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.links import fill_remainder
from swarmwire.comms.radio.phy.state import NO_RESULT
from swarmwire.comms.radio.propagation.decibels import to_db
from swarmwire.comms.radio.timing import IEEE_802_15_4
from swarmwire.comms.radio.transmissions import (
    DECIDED,
    Admission,
    SentColumns,
    Transmissions,
    admit,
    frame_sizes,
    size_row,
)
from swarmwire.comms.robot.packets import NO_TX_STATUSES, Fate, SentPackets, TxResult, TxStatuses

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
    """The packets that are not done yet, in two tables with the same rows.

    Attributes:
        queued: the packets.
        table: their state in the events, of dtype PACKET or, with 802.11n, MPDU.
    """

    def __init__(self, rows: int, kind: np.dtype[Any]) -> None:
        self.queued, self.table, self._kind = Transmissions(), np.zeros(0, kind), kind
        self._admission = Admission(rows, self.queued)

    def __len__(self) -> int:
        return len(self.table)

    @property
    def any_done(self) -> bool:
        """True if packets are done, which `forget_done` would remove."""
        return bool(self.table["is_done"].any())

    def accept(
        self,
        sent_at_ns: IntArray,
        sent: SentPackets,
        others_alive: IntArray,
        epoch: int,
        counts: AnyArray,
        frames: "Frames",
    ) -> int:
        """Append sent packets; see `admit`."""
        table: Table = np.zeros(len(self.table) + len(sent), self._kind)
        table.view(np.uint8)[: self.table.nbytes] = self.table.view(np.uint8)  # much faster than by fields
        params = table, frames
        result = self._admission.accept(_accept, sent_at_ns, sent, others_alive, epoch, counts, params)
        if result == NO_PACKET:
            self.table = table
        return result

    def forget_done(self) -> bool:
        """Remove packets that are done, and return True if any was; recorded receptions are no longer intended."""
        unfinished, count = _settle(self.table, self.queued.table), len(self.table)
        if np.count_nonzero(unfinished) < count:
            self.table = self.table[unfinished]
            self.queued.keep(unfinished)
        return len(self.table) < count

    def drain(self) -> Table:
        """Remove and return all packets."""
        packets = self.queued.rows.copy()
        self.queued.used[:] = 0
        self.table = np.zeros(0, self._kind)
        return packets


class Frames(NamedTuple):
    """Frames of a radio, a row per size of packets, see `size_row`."""

    headers_bytes: int
    bits: IntArray
    airtime_ns: IntArray
    broadcast_ns: IntArray  # airtime of broadcasts
    ifs_ns: IntArray  # interframe space after the frame


def frames_of(radio: Radio) -> Frames:
    """Return the frames of a radio."""
    headers_bytes, sizes = frame_sizes(radio)
    ifs_ns = np.zeros(len(sizes), np.int64)
    if radio.access_or_default.method == "csma-802154":
        ifs_ns = IEEE_802_15_4.ifs_ns(sizes - HEADER_BYTES)
    bits = frame_bits(radio, sizes)
    return Frames(headers_bytes, bits, airtime_ns(radio, sizes), broadcast_airtime_ns(radio, sizes), ifs_ns)


@njit()
def _accept(
    packets: Any,
    data: Any,
    used: Any,
    sent: SentColumns,
    others_alive: Any,
    epoch: int,
    sent_before: Any,
    counts: Any,
    table: Any,
    frames: Frames,
) -> int:
    """Admit sent packets, see `admit`, and fill in their rows of `table` of dtype PACKET."""
    first, robots = used[0], len(sent_before) // len(counts)
    result = admit(packets, data, used, sent, others_alive, epoch, sent_before, counts)
    for k in range(first, used[0]):
        row, admitted = table[k], packets[k]
        size, to = size_row(admitted, frames.headers_bytes), admitted.to
        row.sender, row.sequence = admitted.sender, admitted.sequence
        row.to = to if to in (BROADCAST, NOWHERE) else admitted.sender - admitted.sender % robots + to
        row.sent_at_ns = row.on_air_at_ns = admitted.sent_at_ns
        row.fate = UNDER_WAY
        if size < len(frames.bits):
            row.bits, row.ifs_ns = frames.bits[size], frames.ifs_ns[size]
            row.airtime_ns = frames.broadcast_ns[size] if to == BROADCAST else frames.airtime_ns[size]
            row.is_too_large, row.result = False, NO_ACKNOWLEDGEMENT
        else:
            row.is_too_large, row.result = True, TX_TOO_LARGE
    return result


@njit()
def _settle(packet: Any, queued: Any):
    """Mark packets with a recorded reception, in both tables; return True for packets that are not done."""
    unfinished = np.empty(len(packet), np.bool_)
    for p in range(len(packet)):
        row = packet[p]
        if row.is_settled:
            row.is_departed = 1
            queued[p].intended = 0
        unfinished[p] = row.is_done == 0
    return unfinished


@njit()
def append_results(
    queued: Any,
    queued_data: Any,
    packet: Any,
    rows: Any,
    is_intended: AnyArray,
    packets: Any,
    data: Any,
    used: Any,
    links: Any,
    link_used: Any,
):
    """Append the packets with result rows, or done since, and the links of these rows; return their poses, (links,).

    `queued` and `queued_data` are the packets in the order of the rows of `packet`, and their payloads; `rows` is a
    `ResultBuffer`; `is_intended` selects its rows with an intended receiver, all if it is empty. The tables `packets`
    and `links` have room.
    """
    row_of_packet, on_air_at_ns = np.full(len(packet), ABSENT), np.empty(len(packet), np.int64)
    for p in range(len(packet)):
        row = packet[p]
        on_air_at_ns[p] = row.on_air_at_ns
        # The reception of a unicast packet may have been in earlier results; its sender has finished it only now.
        if row.is_done and not row.is_departed:
            row_of_packet[p] = 0
    receiver = rows.receiver
    for k in range(rows.count[0]):
        row_of_packet[rows.packet[k]], on_air_at_ns[rows.packet[k]] = 0, rows.on_air_at_ns[k]
    first, size = used[0], used[1]
    for p in range(len(packet)):
        if row_of_packet[p] == 0:
            row_of_packet[p], reported, row = used[0], packets[used[0]], packet[p]
            packets[used[0]] = queued[p]
            reported.step, reported.fate, reported.first_byte = DECIDED, row.fate, size
            reported.on_air_at_ns = reported.off_air_at_ns = on_air_at_ns[p]
            if row.fate == UNDER_WAY:
                reported.off_air_at_ns += row.airtime_ns
            for i in range(reported.size_bytes):
                data[size + i] = queued_data[queued[p].first_byte + i]
            size += reported.size_bytes
            used[0] += 1
    used[1] = size
    remaining, pose_id = np.empty(used[0] - first, np.int64), np.empty(rows.count[0], np.int64)
    for p in range(len(remaining)):
        remaining[p] = packets[first + p].intended
    i = link_used[0]
    for k in range(rows.count[0]):
        if receiver[k] != NO_ROBOT and (len(is_intended) == 0 or is_intended[k]):
            p, link = row_of_packet[rows.packet[k]], links[i]
            remaining[p - first] -= 1
            link.packet, link.sender, link.receiver, link.receiver_count = p, packets[p].sender, receiver[k], 1
            link.in_range, link.fate, link.final_at_ns = rows.in_range[k], rows.fate[k], rows.final_at_ns[k]
            link.rssi_dbm, pose_id[i - link_used[0]] = to_db(rows.power_mw[k]), rows.pose_id[k]
            i += 1
    count = i - link_used[0]
    for p in range(first, used[0]):
        fill_remainder(links[i], packets[p], p, remaining[p - first], 0)
        i += 1
    link_used[0] = i
    return pose_id[:count]
