"""Results of the medium: received packets in delivery order, and records of links whose fate became final.

Kernels index rows by unsigned integers: compiled code checks signed ones for counting from the end, which takes three
times as long.
"""

# pyright: basic, reportUnknownMemberType=false

from dataclasses import dataclass, field
from functools import reduce
from operator import add

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, ByteArray, IntArray
from swarmwire.comms.base.clock import NEVER_NS
from swarmwire.comms.base.kernels import kernel, njit
from swarmwire.comms.base.sentinels import NO_ROBOT, UNDER_WAY
from swarmwire.comms.radio import links as link
from swarmwire.comms.radio import transmissions as packet
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.links import OUT_OF_RANGE, RECEIVED, OpenLinks, renumbered
from swarmwire.comms.radio.records import ON_AIR, PacketCounts, ReceptionRecords, TransmissionRecords
from swarmwire.comms.radio.transmissions import payload_rows
from swarmwire.comms.robot.packets import Payloads, ReceivedPackets, TxStatuses

NO_EDGES = np.empty((0, 2), np.int64)


@njit()
def sort_by_receiver(
    index: IntArray, receiver: IntArray, received_at_ns: IntArray, sender: IntArray, rows: int
) -> IntArray:
    """Return the rows of `index` (k,), one or more, sorted by (receiver, received_at, sender); stable, (k,)."""
    order = index.view(np.uint64)
    if not _rises(order, received_at_ns):
        order = _counting_sort(order, *_time_bins(order, received_at_ns))
    # With rows sorted roughly by time, then by receiver, the insertion sort moves almost nothing.
    order = _counting_sort(order, receiver, rows)
    _insertion_sort(order, receiver, received_at_ns, sender)
    return order.view(np.int64)


@njit()
def _rises(order, at_ns):
    """Return True if the times of rows in this order never fall, as those of a PHY's events."""
    k = 1
    while k < len(order) and at_ns[order[k - 1]] <= at_ns[order[k]]:
        k += 1
    return k >= len(order)


@njit()
def _counting_sort(order, key, keys):
    """Return `order` sorted by key[row], 0 to keys - 1; stable."""
    start = np.zeros(keys + 1, np.int64)
    keys_of_rows = key.view(np.uint64)
    for row in order:
        start[keys_of_rows[row] + np.uint64(1)] += 1
    for k in range(len(start) - 1):
        start[k + 1] += start[k]
    out = np.empty_like(order)
    for row in order:
        position = np.uint64(start[keys_of_rows[row]])
        start[keys_of_rows[row]] += 1  # before the write to `out`, which the processor would otherwise wait for
        out[position] = row
    return out


@njit()
def _time_bins(order, at_ns):
    """Return the time bin of each row, for about as many bins of equal width as rows; and the number of bins."""
    first_ns = last_ns = at_ns[order[0]]
    for row in order:
        first_ns, last_ns = min(first_ns, at_ns[row]), max(last_ns, at_ns[row])
    shift = 0
    while (last_ns - first_ns) >> shift > len(order):
        shift += 1
    time_bin = np.empty(len(at_ns), np.int64)
    for row in order:
        time_bin[row] = (at_ns[row] - first_ns) >> shift
    return time_bin, ((last_ns - first_ns) >> shift) + 1


@njit()
def _insertion_sort(order, receiver, at_ns, sender):
    """Sort rows that are grouped by receiver by (time, sender) within each group; in place, stable."""
    for k in range(1, len(order)):
        row, position = order[k], np.uint64(k)
        while position > 0 and _precedes(row, order[position - np.uint64(1)], receiver, at_ns, sender):
            order[position] = order[position - np.uint64(1)]
            position -= np.uint64(1)
        order[position] = row


@kernel()
def _precedes(row, other, receiver, at_ns, sender):
    if receiver[row] != receiver[other] or at_ns[row] > at_ns[other]:
        return False
    return at_ns[row] < at_ns[other] or sender[row] < sender[other]


@dataclass(frozen=True, slots=True)
class Results:
    """Receptions, fates and transmit statuses that became final in a stretch of time, and the radio graph."""

    received: ReceivedPackets
    finished: ReceptionRecords
    departed: TransmissionRecords
    tx_status: TxStatuses  # statuses that were requested, of senders that are alive
    tally: PacketCounts
    # (e, 2) the radio graph: robot rows a < b, sorted. An edge joins two robots that are alive if a lone packet is
    # delivered in both directions with at least `min_delivery`.
    edges: IntArray = field(default_factory=lambda: NO_EDGES)

    def in_arenas(self, arenas: BoolArray, robots: int) -> "Results":
        """Return the results of arenas `arenas` (arenas,), of `robots` robots each, without the radio graph."""
        received = self.received.select(np.flatnonzero(arenas[self.received.receiver // robots])).compacted()
        tx_status = self.tx_status.select(np.flatnonzero(arenas[self.tx_status.row // robots]))
        finished, departed = self.finished.in_arenas(arenas), self.departed.in_arenas(arenas)
        return Results(received, finished, departed, tx_status, self.tally.in_arenas(arenas))

    @classmethod
    def joined(cls, parts: "list[Results]") -> "Results":
        """Return the results of all parts of a stretch of time, one or more, in order."""
        if len(parts) == 1:
            return parts[0]
        return cls(
            ReceivedPackets.joined([part.received for part in parts]),
            ReceptionRecords.joined([part.finished for part in parts]),
            TransmissionRecords.joined([part.departed for part in parts]),
            TxStatuses.joined([part.tx_status for part in parts]),
            reduce(add, [part.tally for part in parts]),
        )


def received_between(
    since_ns: int, until_ns: int, open_links: OpenLinks, measures: tuple[str, ...], robots: int
) -> tuple[ReceivedPackets, int]:
    """Return the packets received after `since_ns` and by `until_ns`, sorted as by `final_by`; the links stay.

    The second value is the time of the next reception, or NEVER_NS.
    """
    tables = _tables(open_links)
    columns, index, data, offset, next_ns = _received_between(since_ns, until_ns, *tables, robots)
    measured = {name: open_links.measured[:, column].take(index) for column, name in enumerate(measures)}
    receiver, sender, sequence, received_at_ns, payload = columns
    payloads = Payloads(data, offset)
    return ReceivedPackets(receiver, sender, sequence, received_at_ns, measured, payload, payloads), next_ns


@njit()
def _received_between(since_ns, until_ns, links, rows, packets, packet_rows, data, offset, robots):
    packet_of, sender, receiver = links[link.PACKET], links[link.SENDER], links[link.RECEIVER]
    fate, final_at_ns = links[link.FATE], links[link.FINAL_AT]
    index, count, next_ns = np.empty(rows, np.int64), 0, NEVER_NS
    for row in range(rows):
        if fate[row] == RECEIVED and final_at_ns[row] > since_ns:
            if final_at_ns[row] <= until_ns:
                index[count] = row
                count += 1
            else:
                next_ns = min(next_ns, final_at_ns[row])
    index = index[:count]
    if count > 0:
        index = sort_by_receiver(index, receiver, final_at_ns, sender, receiver[index].max() + 1)
    used, payload = renumbered(packet_of[index], packet_rows)
    first_row = packets[packet.SENDER, :packet_rows] // robots * robots
    return _received(index, payload, links, first_row), index, *payload_rows(data, offset, used), next_ns


def final_by(
    until_ns: int, open_links: OpenLinks, radio: Radio, robots: int, counts: tuple[IntArray, IntArray]
) -> tuple[ReceivedPackets, ReceptionRecords, TransmissionRecords, IntArray]:
    """Return the results of links that are final by `until_ns`, and the rows of the links that are still open.

    Received packets are sorted by (receiver, received_at, sender, sequence). Each arena has `robots` robots. Adds to
    `counts`: fates (arenas, fates) and receivers in range (arenas,).
    """
    tables = _tables(open_links)
    received, payloads, finished, finished_index, departed, open_rows = _final(until_ns, *tables, robots, *counts)
    index, data, offset = payloads
    sent_payloads = open_links.transmissions.payloads
    *numbers, payload = received
    measured = {name: open_links.measured[:, column].take(index) for column, name in enumerate(radio.measures.columns)}
    rssi_dbm = open_links.rssi_dbm.take(finished_index) if radio.is_phy else None
    *records, finished_payload = finished
    return (
        ReceivedPackets(*numbers, measured=measured, payload=payload, payloads=Payloads(data, offset)),
        ReceptionRecords(*records, rssi_dbm=rssi_dbm, payload=finished_payload, payloads=sent_payloads),
        TransmissionRecords(*departed),
        open_rows,
    )


def _tables(open_links: OpenLinks) -> tuple[IntArray, int, IntArray, int, ByteArray, IntArray]:
    """Return the links, their number, the packets, their number, and the packets' payloads, as kernels take them."""
    payloads = open_links.data, open_links.offset
    return open_links.table, open_links.link_count, open_links.packet_table, open_links.packet_count, *payloads


@njit(nogil=True)
def _final(until_ns, links, rows, packets, packet_rows, data, offset, robots, fates, in_range):
    """Return the tables of `final_by`: each row of a table is a column of a result, in their order.

    A link may have several kinds of results: received; finished, without receivers out of range; and departed, one for
    each packet that left its sender's radio, in the row for its remaining receivers. AssertionError if a link has no
    fate.
    """
    packet_of, sender, receiver = links[link.PACKET], links[link.SENDER], links[link.RECEIVER]
    fate, final_at_ns = links[link.FATE], links[link.FINAL_AT]
    highest = np.uint64(0)  # read as an unsigned number, a sentinel is above all fates
    for row in range(rows):
        highest = max(highest, np.uint64(fate[row]))
    if highest >= np.uint64(fates.shape[1]):
        raise AssertionError("a link has no fate: no stage of the radio model decided it")
    # One division per packet, since one per link would double the time of this kernel.
    arena = packets[packet.SENDER, :packet_rows] // robots
    receiver_count, in_range_count = links[link.RECEIVER_COUNT], links[link.IN_RANGE]
    # Each row of `kinds` begins with the links of one kind.
    kinds = np.empty((4, rows), np.int64)
    received, finished, departed, open_rows = kinds
    h, f, d, o = np.uint64(0), np.uint64(0), np.uint64(0), np.uint64(0)
    for row in range(np.uint64(rows)):
        # Branchless: write first, then advance if it counts.
        received[h], finished[f], departed[d], open_rows[o] = row, row, row, row
        final = final_at_ns[row] <= until_ns
        h += np.uint64(final & (fate[row] == RECEIVED))
        f += np.uint64(final & (fate[row] != OUT_OF_RANGE))
        d += np.uint64(final & (receiver[row] == NO_ROBOT))
        o += np.uint64(not final)
        a = np.uint64(arena[np.uint64(packet_of[row])])
        fates[a, np.uint64(fate[row])] += final * receiver_count[row]
        in_range[a] += final * in_range_count[row]
    index = received[:h]
    if h > 0:
        index = sort_by_receiver(index, receiver, final_at_ns, sender, len(fates) * robots)
    used, payload = renumbered(packet_of[index], packet_rows)
    return (
        _received(index, payload, links, arena * robots),
        (index, *payload_rows(data, offset, used)),
        _finished(finished[:f], links, packets, offset, arena, robots),
        finished[:f],
        _departed(departed[:d], links, packets, arena, robots),
        open_rows[:o],
    )


@njit()
def _received(index, payload, links, first_row):
    """Return receiver, index of the sender, sequence, time of reception and payload, (5, k).

    `first_row` is the first robot row of each packet's arena.
    """
    packet_of, sender, receiver = links[link.PACKET], links[link.SENDER], links[link.RECEIVER]
    sequence, final_at_ns = links[link.SEQUENCE], links[link.FINAL_AT]
    columns = np.empty((5, len(index)), np.int64)
    for k in range(len(index)):
        row = np.uint64(index[k])
        columns[0, k], columns[1, k], columns[2, k] = (
            receiver[row],
            sender[row] - first_row[packet_of[row]],
            sequence[row],
        )
        columns[3, k], columns[4, k] = final_at_ns[row], payload[k]
    return columns


@njit()
def _finished(index, links, packets, offset, arena, robots):
    """Return the integer columns of `ReceptionRecords`, then the rows of payloads, (13, k)."""
    packet_of, receiver, receiver_count = links[link.PACKET], links[link.RECEIVER], links[link.RECEIVER_COUNT]
    fate, final_at_ns = links[link.FATE], links[link.FINAL_AT]
    sender, to = packets[packet.SENDER], packets[packet.TO]
    sequence, tag = packets[packet.SEQUENCE], packets[packet.TAG]
    sent_at_ns, on_air_at_ns = packets[packet.SENT_AT], packets[packet.ON_AIR_AT]
    columns = np.empty((13, len(index)), np.int64)
    for k in range(len(index)):
        row = np.uint64(index[k])
        p = np.uint64(packet_of[row])
        first_row = arena[p] * robots
        columns[0, k], columns[1, k] = arena[p], sender[p] - first_row
        columns[2, k] = NO_ROBOT if receiver[row] == NO_ROBOT else receiver[row] - first_row
        columns[3, k], columns[4, k], columns[5, k] = receiver_count[row], to[p], sequence[p]
        columns[6, k], columns[7, k], columns[8, k] = sent_at_ns[p], on_air_at_ns[p], final_at_ns[row]
        columns[9, k], columns[10, k] = fate[row], offset[p + np.uint64(1)] - offset[p]
        columns[11, k], columns[12, k] = tag[p], packet_of[row]
    return columns


@njit()
def _departed(index, links, packets, arena, robots):
    """Return the columns of `TransmissionRecords`, (9, k)."""
    packet_of, sender, sequence = links[link.PACKET], links[link.SENDER], links[link.SEQUENCE]
    receiver_count, fate = links[link.RECEIVER_COUNT], links[link.FATE]
    to, intended, fate_at_sender = packets[packet.TO], packets[packet.INTENDED], packets[packet.FATE]
    on_air_at_ns, off_air_at_ns = packets[packet.ON_AIR_AT], packets[packet.OFF_AIR_AT]
    columns = np.empty((9, len(index)), np.int64)
    for k in range(len(index)):
        row = np.uint64(index[k])
        p = np.uint64(packet_of[row])
        columns[0, k], columns[1, k], columns[2, k] = arena[p], sender[row] - arena[p] * robots, to[p]
        columns[3, k], columns[4, k] = sequence[row], intended[p]
        columns[5, k] = receiver_count[row] if fate[row] == OUT_OF_RANGE else 0
        columns[6, k] = ON_AIR if fate_at_sender[p] == UNDER_WAY else fate_at_sender[p]
        columns[7, k], columns[8, k] = on_air_at_ns[p], off_air_at_ns[p]
    return columns
