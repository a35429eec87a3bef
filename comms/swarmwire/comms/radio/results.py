"""Results of the medium: received packets in delivery order, and records of links whose fate became final.

Kernels index rows by unsigned integers: compiled code checks signed ones for counting from the end, which takes three
times as long.
"""

# pyright: basic, reportUnknownMemberType=false

from dataclasses import field
from functools import reduce
from operator import add

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, BoolArray, IntArray
from swarmwire.comms.base.clock import NEVER_NS
from swarmwire.comms.base.kernels import kernel, njit
from swarmwire.comms.base.sentinels import ABSENT, NO_ROBOT, UNDER_WAY
from swarmwire.comms.base.tick_record import tick_record
from swarmwire.comms.radio.links import OUT_OF_RANGE, RECEIVED, Links, keep_links
from swarmwire.comms.radio.records import ON_AIR, PacketCounts, ReceptionRecords, TransmissionRecords
from swarmwire.comms.radio.transmissions import Transmissions
from swarmwire.comms.robot.packets import Payloads, ReceivedPackets, TxStatuses

NO_EDGES = np.empty((0, 2), np.int64)


@njit()
def order_of_delivery(receiver: AnyArray, at_ns: AnyArray, sender: AnyArray, rows: int):
    """Return the rows sorted by (receiver, time, sender), (k,), all below `rows`; stable."""
    order = np.empty(len(receiver), np.uint64)
    if len(order) == 0:
        return order
    for row in range(len(order)):
        order[row] = row
    if not _rises(at_ns):
        order = _counting_sort(order, *_time_bins(at_ns))
    # With rows sorted roughly by time, then by receiver, the insertion sort moves almost nothing.
    order = _counting_sort(order, receiver, rows)
    _insertion_sort(order, receiver, at_ns, sender)
    return order


@njit()
def _rises(at_ns):
    """Return True if the times never fall, as those of a PHY's events."""
    k = 1
    while k < len(at_ns) and at_ns[k - 1] <= at_ns[k]:
        k += 1
    return k >= len(at_ns)


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
def _time_bins(at_ns):
    """Return the time bin of each row, for about as many bins of equal width as rows; and the number of bins."""
    first_ns, last_ns, shift = at_ns[0], at_ns[0], 0
    for time_ns in at_ns:  # min() and max() of numba take a second to compile
        first_ns, last_ns = min(first_ns, time_ns), max(last_ns, time_ns)
    while (last_ns - first_ns) >> shift > len(at_ns):
        shift += 1
    return (at_ns - first_ns) >> shift, ((last_ns - first_ns) >> shift) + 1


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


@tick_record
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
    since_ns: int, until_ns: int, packets: Transmissions, links: Links, robots: int, measures: tuple[str, ...]
) -> tuple[ReceivedPackets, int]:
    """Return the packets received after `since_ns` and by `until_ns`, sorted as by `final_by`; the links stay.

    The second value is the time of the next reception, or NEVER_NS.
    """
    next_ns, received = _received_between(
        *(since_ns, until_ns, packets.table, packets.data, packets.used, links.table, links.used, robots),
        len(measures) > 0,
    )
    return _packets_of(received, measures), next_ns


def final_by(
    until_ns: int,
    packets: Transmissions,
    links: Links,
    robots: int,
    counts: AnyArray,
    measures: tuple[str, ...],
    *,
    has_power: bool,
) -> tuple[ReceivedPackets, ReceptionRecords, TransmissionRecords]:
    """Return the results of links that are final by `until_ns`, and remove these links and their packets.

    Received packets are sorted by (receiver, received_at, sender, sequence). Each arena has `robots` robots. Adds to
    `counts`, (arenas,) of type COUNTS. `measures` are the names of the receivers' measurements.
    """
    received, finished, rssi_dbm, data, offset, departed = _final(
        *(until_ns, packets.table, packets.data, packets.used, links.table, links.used, robots, counts),
        *(len(measures) > 0, has_power),
    )
    payloads, rssi = Payloads(data, offset), rssi_dbm if has_power else None
    return (
        _packets_of(received, measures),
        ReceptionRecords(*finished[:-1], rssi_dbm=rssi, payload=finished[-1], payloads=payloads),
        TransmissionRecords(*departed),
    )


def _packets_of(received: tuple[AnyArray, ...], measures: tuple[str, ...]) -> ReceivedPackets:
    """Return the result of `_received`."""
    columns, measured, data, offset = received
    by_name = {name: measured[MEASUREMENTS.index(name)] for name in measures}
    receiver, sender_index, sequence, received_at_ns, payload = columns
    payloads = Payloads(data, offset)
    return ReceivedPackets(receiver, sender_index, sequence, received_at_ns, by_name, payload, payloads)


# Names in `ReceivedPackets.measured`, in the order of `_received`.
MEASUREMENTS = ("range_m", "bearing_rad", "rssi_dbm")


@njit()
def _received_between(since_ns, until_ns, packets, data, used, links, link_used, robots, has_measures):
    rows, next_ns, k = np.empty(link_used[0], np.uint64), NEVER_NS, 0
    for row in range(link_used[0]):
        link = links[row]
        if link.fate == RECEIVED and link.final_at_ns > since_ns:
            if link.final_at_ns <= until_ns:
                rows[k] = row
                k += 1
            else:
                next_ns = min(next_ns, link.final_at_ns)
    return next_ns, _received(rows[:k], packets, data, used, links, robots, has_measures)


@njit(nogil=True)
def _final(until_ns, packets, data, used, links, link_used, robots, counts, has_measures, has_power):
    """Return the tables of `final_by`: each row of a table is a column of a result, in their order.

    A link may have several kinds of results: received; finished, without receivers out of range; and departed, one for
    each packet that left its sender's radio, in the row for its remaining receivers. AssertionError if a link has no
    fate.
    """
    # One division per packet, since one per link would double the time of this kernel.
    arena = np.empty(used[0], np.uint64)
    for p in range(used[0]):
        arena[p] = packets[p].sender // robots
    kinds, is_open = np.empty((3, link_used[0]), np.uint64), np.empty(link_used[0], np.bool_)
    received, finished, departed = kinds
    h, f, d = np.uint64(0), np.uint64(0), np.uint64(0)
    for row in range(np.uint64(link_used[0])):
        link = links[row]
        if np.uint64(link.fate) >= np.uint64(len(counts[0].fates)):  # a sentinel is above all fates
            raise AssertionError("a link has no fate: the radio model did not decide it")
        # Branchless: write first, then advance if it counts.
        received[h], finished[f], departed[d] = row, row, row
        final, in_arena = link.final_at_ns <= until_ns, counts[arena[link.packet]]
        h += np.uint64(final & (link.fate == RECEIVED))
        f += np.uint64(final & (link.fate != OUT_OF_RANGE))
        d += np.uint64(final & (link.receiver == NO_ROBOT))
        is_open[row] = not final
        in_arena.fates[link.fate] += final * link.receiver_count
        in_arena.in_range += final * link.in_range
    offset = np.empty(used[0] + 1, np.int64)
    for p in range(used[0]):
        offset[p] = packets[p].first_byte
    offset[used[0]] = used[1]
    results = (
        _received(received[:h], packets, data, used, links, robots, has_measures),
        *_finished(finished[:f], packets, links, arena, robots, has_power),
        data[: used[1]].copy(),
        offset,
        _departed(departed[:d], packets, links, arena, robots),
    )
    keep_links(links, link_used, is_open, packets, data, used)
    return results


@njit()
def _received(rows, packets, data, used, links, robots, has_measures):
    """Return the packets received on the links `rows`: columns (5, k), measurements (3, k) and payloads.

    The columns are receiver, index of the sender, sequence, time of reception and row of the payload.
    """
    k, first_row = len(rows), np.empty(used[0], np.int64)
    for p in range(used[0]):
        first_row[p] = packets[p].sender // robots * robots
    # In columns, since the order of delivery reads them in random order.
    receiver, at_ns, sender, sequence = (
        np.empty(k, np.int64),
        np.empty(k, np.int64),
        np.empty(k, np.int64),
        np.empty(k, np.int64),
    )
    packet_of, payload, count, size, last = np.empty(k, np.int64), np.full(used[0], ABSENT), 0, 0, 0
    for n in range(np.uint64(k)):
        link = links[rows[n]]
        p = np.uint64(link.packet)
        receiver[n], at_ns[n], packet_of[n] = link.receiver, link.final_at_ns, p
        sender[n], sequence[n] = link.sender - first_row[p], packets[p].sequence
        payload[p], last = 0, max(last, link.receiver)
    for p in range(used[0]):
        if payload[p] != ABSENT:
            payload[p], count, size = count, count + 1, size + packets[p].size_bytes
    received_data, offset, size = np.empty(size, np.uint8), np.zeros(count + 1, np.int64), 0
    for p in range(used[0]):
        if payload[p] != ABSENT:
            for i in range(packets[p].size_bytes):  # byte by byte: slices count references
                received_data[size + i] = data[packets[p].first_byte + i]
            size += packets[p].size_bytes
            offset[payload[p] + 1] = size
    order = order_of_delivery(receiver, at_ns, sender, last + 1)
    columns, measured = np.empty((5, k), np.int64), np.empty((3, k if has_measures else 0))
    for n in range(np.uint64(k)):
        i = order[n]
        columns[0, n], columns[1, n], columns[2, n] = receiver[i], sender[i], sequence[i]
        columns[3, n], columns[4, n] = at_ns[i], payload[packet_of[i]]
    if has_measures:
        for n in range(np.uint64(k)):
            link = links[rows[order[n]]]
            measured[0, n], measured[1, n], measured[2, n] = link.range_m, link.bearing_rad, link.measured_rssi_dbm
    return columns, measured, received_data, offset


@njit()
def _finished(rows, packets, links, arena, robots, has_power):
    """Return the integer columns of `ReceptionRecords`, then the rows of payloads, (13, k); and the power, (k,)."""
    columns = np.empty((13, len(rows)), np.int64)
    for k in range(np.uint64(len(rows))):
        link = links[rows[k]]
        p = np.uint64(link.packet)
        packet, first_row = packets[p], np.int64(arena[p]) * robots
        columns[0, k], columns[1, k] = arena[p], packet.sender - first_row
        columns[2, k] = NO_ROBOT if link.receiver == NO_ROBOT else link.receiver - first_row
        columns[3, k], columns[4, k], columns[5, k] = link.receiver_count, packet.to, packet.sequence
        columns[6, k], columns[7, k], columns[8, k] = packet.sent_at_ns, packet.on_air_at_ns, link.final_at_ns
        columns[9, k], columns[10, k] = link.fate, packet.size_bytes
        columns[11, k], columns[12, k] = packet.tag, p
    rssi_dbm = np.empty(len(rows) if has_power else 0)
    for k in range(np.uint64(len(rssi_dbm))):
        rssi_dbm[k] = links[rows[k]].rssi_dbm
    return columns, rssi_dbm


@njit()
def _departed(rows, packets, links, arena, robots):
    """Return the columns of `TransmissionRecords`, (9, k)."""
    columns = np.empty((9, len(rows)), np.int64)
    for k in range(np.uint64(len(rows))):
        link = links[rows[k]]
        p = np.uint64(link.packet)
        packet = packets[p]
        columns[0, k], columns[1, k], columns[2, k] = arena[p], packet.sender - np.int64(arena[p]) * robots, packet.to
        columns[3, k], columns[4, k] = packet.sequence, packet.intended
        columns[5, k] = link.receiver_count if link.fate == OUT_OF_RANGE else 0
        columns[6, k] = ON_AIR if packet.fate == UNDER_WAY else packet.fate
        columns[7, k], columns[8, k] = packet.on_air_at_ns, packet.off_air_at_ns
    return columns
