"""What senders learn of their packets, where radios acknowledge."""

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
from swarmwire.comms.radio.phy.state import NOT_LEARNED, PACKET, Table
from swarmwire.comms.radio.timing import IEEE_802_15_4
from swarmwire.comms.radio.transmissions import Transmissions
from swarmwire.comms.truth import NO_ROBOT


def learned(packet: Table, tx_status_id: IntArray) -> TxStatuses:
    """Of packets that are done, what senders learn who ask; those that died before are not there to learn it."""
    died = (packet["fate"] == Fate.SENDER_DEAD) | (packet["result"] == NOT_LEARNED)
    asked = (packet["is_done"] > 0) & (tx_status_id != NOT_MEASURED) & ~died
    index = np.flatnonzero(asked)
    if not len(index):
        return NO_TX_STATUSES
    return TxStatuses(packet["sender"][index], tx_status_id[index], packet["result"][index])


def sent_in_vain(sent: SentPackets, max_payload_bytes: int) -> TxStatuses:
    """Of packets to robots that are not there, what senders learn who ask: nobody answers."""
    index = np.flatnonzero((sent.to == NOWHERE) & (sent.tx_status_ids != NOT_MEASURED))
    if not len(index):
        return NO_TX_STATUSES
    return TxStatuses(
        sent.sender[index], sent.tx_status_ids[index], result_at_first(sent.payloads.sizes[index], max_payload_bytes)
    )


def result_at_first(size_bytes: IntArray, max_payload_bytes: int) -> IntArray:
    """The results of packets (k,) until something better, or worse, comes of them."""
    return np.where(size_bytes > max_payload_bytes, int(TxResult.TOO_LARGE), int(TxResult.NO_ACKNOWLEDGEMENT))


# --- Packets that wait at their radios or are under way, and their rows in the table that events work on.


HEADER_BYTES = 6  # of IEEE 802.15.4 before its PSDU


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
        """Radios took up these packets; `robots` stand in each arena."""
        self.queued = self.queued.followed_by(taken)
        self.table = np.concatenate([self.table, packet_rows(taken, radio, robots)])

    def by_sender(self, rows: int) -> tuple[IntArray, IntArray]:
        """Packets in order of `rows` senders and of sending, and where each robot's start in that, (rows + 1,)."""
        sender = self.table["sender"]
        order = np.argsort(sender, kind="stable")
        return order, np.searchsorted(sender[order], np.arange(rows + 1))

    def forget_done(self) -> None:
        """Packets that are done are gone; those whose one receiver received them are meant for nobody any more."""
        settled = self.table["is_settled"] > 0
        kept = np.flatnonzero(self.table["is_done"] == 0)
        self.table["is_departed"] |= settled
        queued = self.queued._replace(intended=np.where(settled, 0, self.queued.intended))
        self.queued, self.table = queued.select(kept), self.table[kept]

    def drain(self) -> Transmissions:
        """Take out all of them."""
        packets, self.queued, self.table = self.queued, Transmissions.none(), np.zeros(0, PACKET)
        return packets


def packet_rows(taken: Transmissions, radio: Radio, robots: int) -> Table:
    """Rows of dtype PACKET for packets that wait at their radios, (k,)."""
    frame_bytes = taken.payloads.sizes + radio.overhead_bytes
    packet: Table = np.zeros(len(taken.sender), PACKET)
    packet["sender"], packet["sequence"] = taken.sender, taken.sequence
    packet["to"] = np.where(taken.to == BROADCAST, NO_ROBOT, taken.sender - taken.sender % robots + taken.to)
    packet["sent_at_ns"] = packet["on_air_at_ns"] = taken.sent_at_ns
    packet["airtime_ns"], packet["bits"] = airtime_ns(radio, frame_bytes), 8 * frame_bytes
    packet["refused"] = np.where(taken.payloads.sizes > radio.max_payload_bytes, int(Fate.TOO_LARGE), 0)
    packet["result"] = result_at_first(taken.payloads.sizes, radio.max_payload_bytes)
    if radio.access_or_default.method == "csma-802154":
        packet["pause_ns"] = IEEE_802_15_4.space_ns(frame_bytes - HEADER_BYTES)
    return packet
