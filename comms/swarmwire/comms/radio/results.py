"""The order in which robots get what they received.

Rows are indexed by unsigned numbers throughout: of signed ones compiled code asks each time whether they count from
the end, which takes three times as long.
"""

# pyright: basic, reportUnknownMemberType=false

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from swarmwire.comms.arrays import BoolArray, IntArray
from swarmwire.comms.packets import ReceivedPackets, TxStatuses
from swarmwire.comms.radio.links import OUT_OF_RANGE, RECEIVED, THE_REST, Links
from swarmwire.comms.radio.transmissions import Transmissions
from swarmwire.comms.truth import PacketCounts, ReceptionRecords, TransmissionRecords


@njit(cache=True)
def by_receiver(index: IntArray, receiver: IntArray, received_at_ns: IntArray, sender: IntArray, rows: int) -> IntArray:
    """The rows of `index` (k,), at least one, by (receiver, received_at, sender), ties as they stand, (k,)."""
    order = index.view(np.uint64)
    for k in range(1, len(order)):
        if sender[order[k]] < sender[order[k - 1]]:  # seldom: packets of a tick stand by sender
            order = _counting_sort(order, sender, rows)
            break
    # Roughly by time, then by receiver: next to nothing is left to move.
    order = _counting_sort(order, *_parts_of_time(order, received_at_ns))
    order = _counting_sort(order, receiver, rows)
    _insertion_sort(order, receiver, received_at_ns)
    return order.view(np.int64)


@njit(cache=True)
def _counting_sort(order, key, keys):
    """`order` by key[row], 0 to keys - 1, ties as they stand."""
    start = np.zeros(keys + 1, np.int64)
    places = key.view(np.uint64)
    for row in order:
        start[places[row] + np.uint64(1)] += 1
    for place in range(len(start) - 1):
        start[place + 1] += start[place]
    out = np.empty_like(order)
    for row in order:
        place = np.uint64(start[places[row]])
        start[places[row]] += 1  # before `out` is written, or the processor waits to see whether that changed it
        out[place] = row
    return out


@njit(cache=True)
def _parts_of_time(order, at_ns):
    """Into which of equal parts of time each row falls, about as many as rows, and how many parts there are."""
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


@njit(cache=True)
def _insertion_sort(order, receiver, at_ns):
    """Rows that stand by receiver, by time within each; in place, ties as they stand."""
    for k in range(1, len(order)):
        moved, place = order[k], k
        while place > 0 and receiver[order[place - 1]] == receiver[moved] and at_ns[order[place - 1]] > at_ns[moved]:
            order[place] = order[place - 1]
            place -= 1
        order[place] = moved


# --- What the medium tells after time has passed: packets received, and links whose fate became final.


@dataclass(frozen=True, slots=True)
class Results:
    """What became final while time passed."""

    received: ReceivedPackets
    finished: ReceptionRecords
    departed: TransmissionRecords
    tally: PacketCounts
    tx_status: TxStatuses  # of packets whose senders ask and are alive


class FinalFates(NamedTuple):
    """What became final in a part of a tick."""

    received: ReceivedPackets
    finished: ReceptionRecords
    departed: TransmissionRecords
    tx_status: TxStatuses

    @property
    def anything(self) -> bool:
        """Whether anything did."""
        return bool(len(self.finished.arena) or len(self.departed.arena) or len(self.tx_status))

    def of(self, arenas: BoolArray, robots: int) -> "FinalFates":
        """What concerns these arenas (arenas,) of so many robots each."""
        received = self.received.select(np.flatnonzero(arenas[self.received.receiver // robots])).compacted()
        tx_status = self.tx_status.select(np.flatnonzero(arenas[self.tx_status.row // robots]))
        return FinalFates(received, self.finished.of(arenas), self.departed.of(arenas), tx_status)


def joined(parts: list[FinalFates]) -> FinalFates:
    """What became final in all parts, one or more."""
    if len(parts) == 1:
        return parts[0]
    received, finished, departed, tx_status = (list(of) for of in zip(*parts, strict=True))
    return FinalFates(
        ReceivedPackets.joined(received),
        ReceptionRecords.joined(finished),
        TransmissionRecords.joined(departed),
        TxStatuses.joined(tx_status),
    )


class Parted(NamedTuple):
    """Rows of links by what is to be told of them, rising; one may be in several."""

    received: IntArray
    finished: IntArray  # final, but for receivers out of range
    departed: IntArray  # final, of packets that left their sender's radio: each has one row for the rest
    open: IntArray  # not final yet


@njit(cache=True)
def parted(fate: IntArray, receiver: IntArray, final_at_ns: IntArray, until_ns: int) -> Parted:
    """The rows of links of which something is final by `until_ns`, and the others."""
    k = len(fate)
    received, finished = np.empty(k, np.int64), np.empty(k, np.int64)
    departed, still_open = np.empty(k, np.int64), np.empty(k, np.int64)
    h, f, d, o = 0, 0, 0, 0
    for row in range(k):
        # Written first and kept if it counts, so that there is no branch to guess.
        received[h], finished[f], departed[d], still_open[o] = row, row, row, row
        final = final_at_ns[row] <= until_ns
        h += final & (fate[row] == RECEIVED)
        f += final & (fate[row] != OUT_OF_RANGE)
        d += final & (receiver[row] == THE_REST)
        o += not final
    return Parted(received[:h], finished[:f], departed[:d], still_open[:o])


def received(
    index: IntArray, links: Links, packets: Transmissions, measures: tuple[str, ...], robots: int, rows: int
) -> ReceivedPackets:
    """The links `index` were received; sorted by (receiver, received_at, sender, sequence)."""
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
    """The fates of the links `index` are final, those of packets that never went on air among them."""
    arena, size_bytes = packets.sender // robots, packets.payloads.sizes
    of_link = links.packet, links.receiver, links.receivers, links.final_at_ns, links.fate
    times = packets.sent_at_ns, packets.on_air_at_ns
    of_packet = arena, packets.sender, packets.to, packets.sequence, *times, size_bytes, packets.tag
    *told, payload = _finished(index, of_link, of_packet, robots)
    rssi_dbm = links.rssi_dbm.take(index) if has_strength else None
    return ReceptionRecords(*told, rssi_dbm=rssi_dbm, payload=payload, payloads=packets.payloads)


@njit(cache=True)
def _finished(index, of_link, of_packet, robots):
    """The columns of `Finished` that are whole numbers, in their order, then that of payloads, (13, k)."""
    packet, receiver, receivers, final_at_ns, fate = of_link
    arena, sender, to, sequence, sent_at_ns, on_air_at_ns, size_bytes, tag = of_packet
    told = np.empty((13, len(index)), np.int64)
    for k in range(len(index)):
        row = np.uint64(index[k])
        p = np.uint64(packet[row])
        first_row = arena[p] * robots
        told[0, k], told[1, k] = arena[p], sender[p] - first_row
        told[2, k] = THE_REST if receiver[row] == THE_REST else receiver[row] - first_row
        told[3, k], told[4, k], told[5, k] = receivers[row], to[p], sequence[p]
        told[6, k], told[7, k], told[8, k] = sent_at_ns[p], on_air_at_ns[p], final_at_ns[row]
        told[9, k], told[10, k], told[11, k], told[12, k] = fate[row], size_bytes[p], tag[p], packet[row]
    return told


def nothing_final(
    links: Links, packets: Transmissions, has_strength: bool
) -> tuple[ReceptionRecords, TransmissionRecords]:
    """The tables of none, for a medium with these kinds of links and packets."""
    none = np.empty(0, np.int64)
    return finished(none, links, packets, 1, has_strength), departed(none, links, packets, 1)


def in_arena(row: IntArray, robots: int) -> IntArray:
    """Indices within their arena of robot rows; numpy divides several at a time, but finds remainders one by one."""
    return row - row // robots * robots


def departed(index: IntArray, links: Links, packets: Transmissions, robots: int) -> TransmissionRecords:
    """The packets of the links `index` left their sender's radio."""
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


@njit(cache=True)
def compacted(index: IntArray, rows: int) -> tuple[IntArray, IntArray]:
    """Which of `rows` rows are referred to, rising, and `index` renumbered to refer to these only."""
    place, kept = np.full(rows, -1), np.empty(rows, np.int64)
    for one in index:
        place[one] = 0
    found = 0
    for row in range(rows):
        if place[row] == 0:
            kept[found], place[row] = row, found
            found += 1
    return kept[:found], place[index]
