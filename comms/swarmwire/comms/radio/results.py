"""Results of the medium: received packets in delivery order, and records of links whose fate became final.

Kernels index rows by unsigned integers: compiled code checks signed ones for counting from the end, which takes three
times as long.
"""

# pyright: basic, reportUnknownMemberType=false

from dataclasses import dataclass, field
from functools import reduce
from operator import add

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, IntArray
from swarmwire.comms.base.clock import NEVER_NS
from swarmwire.comms.base.kernels import kernel, njit
from swarmwire.comms.base.sentinels import NO_ROBOT, UNDER_WAY
from swarmwire.comms.radio import links as link
from swarmwire.comms.radio import transmissions as packet
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.links import OUT_OF_RANGE, RECEIVED, OpenLinks, compacted
from swarmwire.comms.radio.records import ON_AIR, PacketCounts, ReceptionRecords, TransmissionRecords
from swarmwire.comms.radio.transmissions import payload_rows
from swarmwire.comms.robot.packets import Payloads, ReceivedPackets, TxStatuses

NO_EDGES = np.empty((0, 2), np.int64)


@njit()
def by_receiver(index: IntArray, receiver: IntArray, received_at_ns: IntArray, sender: IntArray, rows: int) -> IntArray:
    """The rows of `index` (k,), at least one, sorted by (receiver, received_at, sender); stable, (k,)."""
    order = index.view(np.uint64)
    if not _rises(order, received_at_ns):
        order = _counting_sort(order, *_time_parts(order, received_at_ns))
    # Roughly by time, then by receiver: the insertion sort then moves almost nothing.
    order = _counting_sort(order, receiver, rows)
    _insertion_sort(order, receiver, received_at_ns, sender)
    return order.view(np.int64)


@njit()
def _rises(order, at_ns):
    """Whether rows in this order never go back in time, as the events of a PHY."""
    k = 1
    while k < len(order) and at_ns[order[k - 1]] <= at_ns[order[k]]:
        k += 1
    return k >= len(order)


@njit()
def _counting_sort(order, key, keys):
    """`order` sorted by key[row], 0 to keys - 1; stable."""
    start = np.zeros(keys + 1, np.int64)
    places = key.view(np.uint64)
    for row in order:
        start[places[row] + np.uint64(1)] += 1
    for place in range(len(start) - 1):
        start[place + 1] += start[place]
    out = np.empty_like(order)
    for row in order:
        place = np.uint64(start[places[row]])
        start[places[row]] += 1  # before the write to `out`, which the processor would otherwise wait for
        out[place] = row
    return out


@njit()
def _time_parts(order, at_ns):
    """The part of time of each row, for about as many equal parts as rows; and the number of parts."""
    first_ns = last_ns = at_ns[order[0]]
    for row in order:
        first_ns, last_ns = min(first_ns, at_ns[row]), max(last_ns, at_ns[row])
    shift = 0
    while (last_ns - first_ns) >> shift > len(order):
        shift += 1
    part = np.empty(len(at_ns), np.int64)
    for row in order:
        part[row] = (at_ns[row] - first_ns) >> shift
    return part, ((last_ns - first_ns) >> shift) + 1


@njit()
def _insertion_sort(order, receiver, at_ns, sender):
    """Sort rows that are grouped by receiver by (time, sender) within each group; in place, stable."""
    for k in range(1, len(order)):
        row, place = order[k], np.uint64(k)
        while place > 0 and _precedes(row, order[place - np.uint64(1)], receiver, at_ns, sender):
            order[place] = order[place - np.uint64(1)]
            place -= np.uint64(1)
        order[place] = row


@kernel()
def _precedes(row, other, receiver, at_ns, sender):
    if receiver[row] != receiver[other] or at_ns[row] > at_ns[other]:
        return False
    return at_ns[row] < at_ns[other] or sender[row] < sender[other]


@dataclass(frozen=True, slots=True)
class Results:
    """What became final in the medium in a stretch of time."""

    received: ReceivedPackets
    finished: ReceptionRecords
    departed: TransmissionRecords
    tx_status: TxStatuses  # of packets with a requested status, of senders that are alive
    tally: PacketCounts
    # (e, 2) the radio graph: robot rows a < b, sorted. Two robots that are alive are joined where a lone packet is
    # delivered with at least `min_delivery`.
    edges: IntArray = field(default_factory=lambda: NO_EDGES)

    def of(self, arenas: BoolArray, robots: int) -> "Results":
        """The results of arenas `arenas` (arenas,), of `robots` robots each."""
        received = self.received.select(np.flatnonzero(arenas[self.received.receiver // robots])).compacted()
        tx_status = self.tx_status.select(np.flatnonzero(arenas[self.tx_status.row // robots]))
        return Results(
            received,
            self.finished.in_arenas(arenas),
            self.departed.in_arenas(arenas),
            tx_status,
            self.tally.in_arenas(arenas),
        )

    @classmethod
    def joined(cls, parts: "list[Results]") -> "Results":
        """The results of all parts of a stretch of time, one or more, in order."""
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
    since_ns: int, until_ns: int, kept: OpenLinks, measures: tuple[str, ...], robots: int
) -> tuple[ReceivedPackets, int]:
    """The packets received after `since_ns` and by `until_ns`, sorted as by `final_by`; the links stay.

    Returns also the time of the next reception, or NEVER_NS.
    """
    tables = kept.table, kept.links, kept.packet_table, kept.packets, kept.data, kept.offset
    columns, index, data, offset, next_ns = _received_between(since_ns, until_ns, *tables, robots)
    given = {name: kept.given[:, column].take(index) for column, name in enumerate(measures)}
    receiver, sender, sequence, received_at_ns, payload = columns
    payloads = Payloads(data, offset)
    return ReceivedPackets(receiver, sender, sequence, received_at_ns, given, payload, payloads), next_ns


@njit()
def _received_between(since_ns, until_ns, links, rows, packets, count, data, offset, robots):
    packet_of, sender, receiver = links[link.PACKET], links[link.SENDER], links[link.RECEIVER]
    fate, final_at_ns = links[link.FATE], links[link.FINAL_AT]
    index, found, next_ns = np.empty(rows, np.int64), 0, NEVER_NS
    for row in range(rows):
        if fate[row] == RECEIVED and final_at_ns[row] > since_ns:
            if final_at_ns[row] <= until_ns:
                index[found] = row
                found += 1
            else:
                next_ns = min(next_ns, final_at_ns[row])
    index = index[:found]
    if found > 0:
        index = by_receiver(index, receiver, final_at_ns, sender, receiver[index].max() + 1)
    kept, place = compacted(packet_of[index], count)
    first_row = packets[packet.SENDER, :count] // robots * robots
    return _received(index, place, links, first_row), index, *payload_rows(data, offset, kept), next_ns


def final_by(
    until_ns: int, kept: OpenLinks, radio: Radio, robots: int, counts: tuple[IntArray, IntArray]
) -> tuple[ReceivedPackets, ReceptionRecords, TransmissionRecords, IntArray]:
    """What is final by `until_ns`, and the rows of the links that are still open.

    Received packets are sorted by (receiver, received_at, sender, sequence). Each arena has `robots` robots. Adds to
    `counts`: fates (arenas, fates) and receivers in range (arenas,).
    """
    tables = kept.table, kept.links, kept.packet_table, kept.packets, kept.data, kept.offset
    found = _final(until_ns, *tables, robots, *counts)
    received, (index, data, offset), finished, finished_index, departed, still_open = found
    *numbers, payload = received
    given = {name: kept.given[:, column].take(index) for column, name in enumerate(radio.measures.columns)}
    rssi_dbm = kept.rssi_dbm.take(finished_index) if radio.is_phy else None
    *records, of_payload = finished
    return (
        ReceivedPackets(*numbers, measured=given, payload=payload, payloads=Payloads(data, offset)),
        ReceptionRecords(*records, rssi_dbm=rssi_dbm, payload=of_payload, payloads=kept.on_air.payloads),
        TransmissionRecords(*departed),
        still_open,
    )


@njit(nogil=True)
def _final(until_ns, links, rows, packets, count, data, offset, robots, fates, in_range):
    """As `final_by`, in tables whose rows are the columns of its results, in their order.

    A link may have several kinds of results: received; finished, without receivers out of range; and departed, those
    for the rest, one for each packet that left its sender's radio.
    """
    packet_of, sender, receiver = links[link.PACKET], links[link.SENDER], links[link.RECEIVER]
    fate, final_at_ns = links[link.FATE], links[link.FINAL_AT]
    # Of each packet: a division for each link would cost as much as all the rest.
    arena = packets[packet.SENDER, :count] // robots
    receivers, reachable = links[link.RECEIVERS], links[link.IN_RANGE]
    # Each row of `kinds` begins with the links of one kind.
    kinds = np.empty((4, rows), np.int64)
    received, finished, departed, still_open = kinds
    h, f, d, o = np.uint64(0), np.uint64(0), np.uint64(0), np.uint64(0)
    for row in range(np.uint64(rows)):
        # Branchless: write first, then advance if it counts.
        received[h], finished[f], departed[d], still_open[o] = row, row, row, row
        final = final_at_ns[row] <= until_ns
        h += np.uint64(final & (fate[row] == RECEIVED))
        f += np.uint64(final & (fate[row] != OUT_OF_RANGE))
        d += np.uint64(final & (receiver[row] == NO_ROBOT))
        o += np.uint64(not final)
        here = np.uint64(arena[np.uint64(packet_of[row])])
        fates[here, np.uint64(fate[row])] += final * receivers[row]
        in_range[here] += final * reachable[row]
    index = received[:h]
    if h > 0:
        index = by_receiver(index, receiver, final_at_ns, sender, len(fates) * robots)
    kept, place = compacted(packet_of[index], count)
    return (
        _received(index, place, links, arena * robots),
        (index, *payload_rows(data, offset, kept)),
        _finished(finished[:f], links, packets, offset, arena, robots),
        finished[:f],
        _departed(departed[:d], links, packets, arena, robots),
        still_open[:o],
    )


@njit()
def _received(index, payload, links, first_row):
    """Receiver, sender in its arena, sequence, time of reception and payload, (5, k).

    `first_row` is that of each packet's arena.
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
    """The integer columns of `ReceptionRecords`, then that of payloads, (13, k)."""
    packet_of, receiver, receivers = links[link.PACKET], links[link.RECEIVER], links[link.RECEIVERS]
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
        columns[3, k], columns[4, k], columns[5, k] = receivers[row], to[p], sequence[p]
        columns[6, k], columns[7, k], columns[8, k] = sent_at_ns[p], on_air_at_ns[p], final_at_ns[row]
        columns[9, k], columns[10, k] = fate[row], offset[p + np.uint64(1)] - offset[p]
        columns[11, k], columns[12, k] = tag[p], packet_of[row]
    return columns


@njit()
def _departed(index, links, packets, arena, robots):
    """The columns of `TransmissionRecords`, (9, k)."""
    packet_of, row_of_sender, sequence = links[link.PACKET], links[link.SENDER], links[link.SEQUENCE]
    receivers, fate = links[link.RECEIVERS], links[link.FATE]
    to, intended, fate_at_sender = packets[packet.TO], packets[packet.INTENDED], packets[packet.FATE]
    on_air_at_ns, off_air_at_ns = packets[packet.ON_AIR_AT], packets[packet.OFF_AIR_AT]
    columns = np.empty((9, len(index)), np.int64)
    for k in range(len(index)):
        row = np.uint64(index[k])
        p = np.uint64(packet_of[row])
        columns[0, k], columns[1, k], columns[2, k] = arena[p], row_of_sender[row] - arena[p] * robots, to[p]
        columns[3, k], columns[4, k] = sequence[row], intended[p]
        columns[5, k] = receivers[row] if fate[row] == OUT_OF_RANGE else 0
        columns[6, k] = ON_AIR if fate_at_sender[p] == UNDER_WAY else fate_at_sender[p]
        columns[7, k], columns[8, k] = on_air_at_ns[p], off_air_at_ns[p]
    return columns
