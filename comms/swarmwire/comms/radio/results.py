"""Results of the medium: received packets in delivery order, and records of links whose fate became final.

Kernels index rows by unsigned integers: compiled code checks signed ones for counting from the end, which takes three
times as long.
"""

# pyright: basic, reportUnknownMemberType=false

from dataclasses import dataclass, field
from functools import reduce
from operator import add

import numpy as np

from swarmwire.comms.arrays import BoolArray, IntArray
from swarmwire.comms.kernels import njit
from swarmwire.comms.packets import NO_TX_STATUSES, ReceivedPackets, TxStatuses
from swarmwire.comms.radio.links import OUT_OF_RANGE, RECEIVED, THE_REST, Links
from swarmwire.comms.radio.transmissions import Transmissions
from swarmwire.comms.truth import PacketCounts, ReceptionRecords, TransmissionRecords

NO_EDGES = np.empty((0, 2), np.int64)


@njit()
def by_receiver(index: IntArray, receiver: IntArray, received_at_ns: IntArray, sender: IntArray, rows: int) -> IntArray:
    """The rows of `index` (k,), at least one, sorted by (receiver, received_at, sender); stable, (k,)."""
    order = index.view(np.uint64)
    for k in range(1, len(order)):
        if sender[order[k]] < sender[order[k - 1]]:  # seldom: packets of a tick are sorted by sender
            order = _counting_sort(order, sender, rows)
            break
    # Roughly by time, then by receiver: the insertion sort then moves almost nothing.
    order = _counting_sort(order, *_time_parts(order, received_at_ns))
    order = _counting_sort(order, receiver, rows)
    _insertion_sort(order, receiver, received_at_ns)
    return order.view(np.int64)


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
def _insertion_sort(order, receiver, at_ns):
    """Sort rows that are grouped by receiver by time within each group; in place, stable."""
    for k in range(1, len(order)):
        value, place = order[k], k
        while place > 0 and receiver[order[place - 1]] == receiver[value] and at_ns[order[place - 1]] > at_ns[value]:
            order[place] = order[place - 1]
            place -= 1
        order[place] = value


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
        return Results(received, self.finished.of(arenas), self.departed.of(arenas), tx_status, self.tally.of(arenas))

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

    @classmethod
    def nothing(
        cls, links: Links, packets: Transmissions, measures: tuple[str, ...], tally: PacketCounts, has_strength: bool
    ) -> "Results":
        """No results, for a medium with these kinds of links and packets."""
        none = np.empty(0, np.int64)
        return cls(
            ReceivedPackets.none(measures),
            finished(none, links, packets, 1, has_strength),
            departed(none, links, packets, 1),
            NO_TX_STATUSES,
            tally,
        )


@njit()
def parted(
    fate: IntArray, receiver: IntArray, final_at_ns: IntArray, until_ns: int
) -> tuple[IntArray, IntArray, IntArray, IntArray]:
    """The rows of links by kind of result, rising: received, finished, departed, open; a row may have several kinds.

    Finished links are final by `until_ns`, without receivers out of range. Departed ones are final rows for the rest:
    one for each packet that left its sender's radio. Open ones are not final yet.
    """
    k = len(fate)
    received, finished = np.empty(k, np.int64), np.empty(k, np.int64)
    departed, still_open = np.empty(k, np.int64), np.empty(k, np.int64)
    h, f, d, o = 0, 0, 0, 0
    for row in range(k):
        # Branchless: write first, then advance if it counts.
        received[h], finished[f], departed[d], still_open[o] = row, row, row, row
        final = final_at_ns[row] <= until_ns
        h += final & (fate[row] == RECEIVED)
        f += final & (fate[row] != OUT_OF_RANGE)
        d += final & (receiver[row] == THE_REST)
        o += not final
    return received[:h], finished[:f], departed[:d], still_open[:o]


def received(
    index: IntArray, links: Links, packets: Transmissions, measures: tuple[str, ...], robots: int, rows: int
) -> ReceivedPackets:
    """Received packets of the links `index`, sorted by (receiver, received_at, sender, sequence)."""
    if not len(index):
        return ReceivedPackets.none(measures)
    index = by_receiver(index, links.receiver, links.final_at_ns, links.sender, rows)
    kept, payload = compacted(links.packet.take(index), len(packets.sender))
    return ReceivedPackets(
        receiver=links.receiver.take(index),
        sender=in_arena(links.sender.take(index), robots),
        sequence=links.sequence.take(index),
        received_at_ns=links.final_at_ns.take(index),
        given={name: links.given[:, column].take(index) for column, name in enumerate(measures)},
        payload=payload,
        payloads=packets.payloads.rows(kept),
    )


def finished(
    index: IntArray, links: Links, packets: Transmissions, robots: int, has_strength: bool
) -> ReceptionRecords:
    """Reception records of the links `index`, with those of packets that never went on air."""
    arena, size_bytes = packets.sender // robots, packets.payloads.sizes
    link_columns = links.packet, links.receiver, links.receivers, links.final_at_ns, links.fate
    times = packets.sent_at_ns, packets.on_air_at_ns
    packet_columns = arena, packets.sender, packets.to, packets.sequence, *times, size_bytes, packets.tag
    *columns, payload = _finished(index, link_columns, packet_columns, robots)
    rssi_dbm = links.rssi_dbm.take(index) if has_strength else None
    return ReceptionRecords(*columns, rssi_dbm=rssi_dbm, payload=payload, payloads=packets.payloads)


@njit()
def _finished(index, link_columns, packet_columns, robots):
    """The integer columns of `ReceptionRecords` in their order, then that of payloads, (13, k)."""
    packet, receiver, receivers, final_at_ns, fate = link_columns
    arena, sender, to, sequence, sent_at_ns, on_air_at_ns, size_bytes, tag = packet_columns
    columns = np.empty((13, len(index)), np.int64)
    for k in range(len(index)):
        row = np.uint64(index[k])
        p = np.uint64(packet[row])
        first_row = arena[p] * robots
        columns[0, k], columns[1, k] = arena[p], sender[p] - first_row
        columns[2, k] = THE_REST if receiver[row] == THE_REST else receiver[row] - first_row
        columns[3, k], columns[4, k], columns[5, k] = receivers[row], to[p], sequence[p]
        columns[6, k], columns[7, k], columns[8, k] = sent_at_ns[p], on_air_at_ns[p], final_at_ns[row]
        columns[9, k], columns[10, k], columns[11, k], columns[12, k] = fate[row], size_bytes[p], tag[p], packet[row]
    return columns


def in_arena(row: IntArray, robots: int) -> IntArray:
    """Indices of robot rows in their arena; numpy vectorizes division, but not the remainder."""
    return row - row // robots * robots


def departed(index: IntArray, links: Links, packets: Transmissions, robots: int) -> TransmissionRecords:
    """Transmission records of the packets of the links `index`, which left their sender's radio."""
    packet, row = links.packet.take(index), links.sender.take(index)
    arena = row // robots
    return TransmissionRecords(
        arena=arena,
        sender=row - arena * robots,
        to=packets.to.take(packet),
        sequence=links.sequence.take(index),
        intended=packets.intended.take(packet),
        out_of_range=np.where(links.fate.take(index) == OUT_OF_RANGE, links.receivers.take(index), 0),
        fate=packets.fate.take(packet),
        on_air_at_ns=packets.on_air_at_ns.take(packet),
        off_air_at_ns=packets.off_air_at_ns.take(packet),
    )


@njit()
def compacted(index: IntArray, rows: int) -> tuple[IntArray, IntArray]:
    """The distinct rows in `index` out of `rows`, rising, and `index` renumbered to refer to these."""
    place, kept = np.full(rows, -1), np.empty(rows, np.int64)
    for row in index:
        place[row] = 0
    count = 0
    for row in range(rows):
        if place[row] == 0:
            kept[count], place[row] = row, count
            count += 1
    return kept[:count], place[index]
