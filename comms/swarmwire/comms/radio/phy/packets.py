"""Packets of the PHY that are not done, and the transmit statuses that senders get where radios acknowledge.

`PacketTable` keeps the packets beside the rows of dtype PACKET that events work on.
"""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.arrays import IntArray
from swarmwire.comms.packets import (
    BROADCAST,
    NO_TX_STATUSES,
    NOT_MEASURED,
    NOWHERE,
    Fate,
    SentPackets,
    TxResult,
    TxStatuses,
)
from swarmwire.comms.radio.config.radio import Radio, airtime_ns
from swarmwire.comms.radio.phy.state import NO_RESULT, PACKET, Table
from swarmwire.comms.radio.timing import IEEE_802_15_4
from swarmwire.comms.radio.transmissions import Transmissions
from swarmwire.comms.truth import NO_ROBOT


def final_statuses(packet: Table, tx_status_id: IntArray) -> TxStatuses:
    """Transmit statuses of packets that are done, where requested; senders that died get none."""
    is_dead = (packet["fate"] == Fate.SENDER_DEAD) | (packet["result"] == NO_RESULT)
    is_reported = (packet["is_done"] > 0) & (tx_status_id != NOT_MEASURED) & ~is_dead
    index = np.flatnonzero(is_reported)
    if not len(index):
        return NO_TX_STATUSES
    return TxStatuses(packet["sender"][index], tx_status_id[index], packet["result"][index])


def statuses_to_nowhere(sent: SentPackets, max_payload_bytes: int) -> TxStatuses:
    """Transmit statuses of packets to NOWHERE, where requested: no acknowledgement comes."""
    index = np.flatnonzero((sent.to == NOWHERE) & (sent.tx_status_ids != NOT_MEASURED))
    if not len(index):
        return NO_TX_STATUSES
    return TxStatuses(
        sent.sender[index], sent.tx_status_ids[index], initial_result(sent.payloads.sizes[index], max_payload_bytes)
    )


def initial_result(size_bytes: IntArray, max_payload_bytes: int) -> IntArray:
    """Results of packets (k,) before any attempt."""
    return np.where(size_bytes > max_payload_bytes, int(TxResult.TOO_LARGE), int(TxResult.NO_ACKNOWLEDGEMENT))


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

    def add(self, taken: Transmissions, radio: Radio, robots: int) -> None:
        """Append packets that radios admitted; each arena has `robots` robots."""
        self.queued = self.queued.followed_by(taken)
        self.table = np.concatenate([self.table, packet_rows(taken, radio, robots)])

    def by_sender(self, rows: int) -> tuple[IntArray, IntArray]:
        """Packet indices sorted by sender, then by order of sending; and each robot's first one, (rows + 1,)."""
        sender = self.table["sender"]
        order = np.argsort(sender, kind="stable")
        return order, np.searchsorted(sender[order], np.arange(rows + 1))

    def forget_done(self) -> None:
        """Drop packets that are done; packets with a recorded reception have no intended receivers left."""
        settled = self.table["is_settled"] > 0
        kept = np.flatnonzero(self.table["is_done"] == 0)
        self.table["is_departed"] |= settled
        queued = self.queued.replaced(intended=np.where(settled, 0, self.queued.intended))
        self.queued, self.table = queued.select(kept), self.table[kept]

    def drain(self) -> Transmissions:
        """Take out all packets."""
        packets, self.queued, self.table = self.queued, Transmissions.none(), np.zeros(0, PACKET)
        return packets


def packet_rows(taken: Transmissions, radio: Radio, robots: int) -> Table:
    """Rows of dtype PACKET for packets that wait at their radios, (k,); `robots` per arena."""
    frame_bytes = taken.payloads.sizes + radio.overhead_bytes
    packet: Table = np.zeros(len(taken.sender), PACKET)
    packet["sender"], packet["sequence"] = taken.sender, taken.sequence
    packet["to"] = np.where(taken.to == BROADCAST, NO_ROBOT, taken.sender - taken.sender % robots + taken.to)
    packet["sent_at_ns"] = packet["on_air_at_ns"] = taken.sent_at_ns
    packet["airtime_ns"], packet["bits"] = airtime_ns(radio, frame_bytes), 8 * frame_bytes
    packet["refused"] = np.where(taken.payloads.sizes > radio.max_payload_bytes, int(Fate.TOO_LARGE), 0)
    packet["result"] = initial_result(taken.payloads.sizes, radio.max_payload_bytes)
    if radio.access_or_default.method == "csma-802154":
        packet["pause_ns"] = IEEE_802_15_4.ifs_ns(frame_bytes - HEADER_BYTES)
    return packet
