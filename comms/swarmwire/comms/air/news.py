"""What the air tells after time has passed: packets heard, and links whose fate became final."""

import numpy as np

from swarmwire.comms.air.links import HEARD, THE_REST, Links
from swarmwire.comms.air.order import by_receiver
from swarmwire.comms.air.transmissions import Transmissions
from swarmwire.comms.arrays import IntArray
from swarmwire.comms.fates import Fate
from swarmwire.comms.packets import Heard
from swarmwire.comms.truth import Departed, Finished

OUT_OF_RANGE = int(Fate.OUT_OF_RANGE)


def heard(ended: Links, packets: Transmissions, gives: tuple[str, ...], robots: int, rows: int) -> Heard:
    """The links that were heard, sorted by (receiver, heard_at, sender, sequence)."""
    index = np.flatnonzero(ended.fate == HEARD)
    if not len(index):
        return Heard.none(gives)
    index = by_receiver(index, ended.receiver, ended.final_at_ns, ended.sender, rows)
    kept, payload = compacted(ended.packet.take(index), len(packets.sender))
    return Heard(
        receiver=ended.receiver.take(index),
        sender=in_arena(ended.sender.take(index), robots),
        sequence=ended.sequence.take(index),
        heard_at_ns=ended.final_at_ns.take(index),
        given={name: ended.given[:, column].take(index) for column, name in enumerate(gives)},
        payload=payload,
        payloads=packets.payloads.rows(kept),
    )


def finished(ended: Links, packets: Transmissions, robots: int, has_strength: bool) -> Finished:
    """The links whose fate is final, and packets that never went on air; not receivers out of range."""
    index = np.flatnonzero(ended.fate != OUT_OF_RANGE)
    packet, row, receiver = ended.packet.take(index), ended.sender.take(index), ended.receiver.take(index)
    arena = row // robots
    return Finished(
        arena=arena,
        sender=row - arena * robots,
        receiver=np.where(receiver == THE_REST, THE_REST, receiver - arena * robots),
        receivers=ended.receivers.take(index),
        to=packets.to.take(packet),
        sequence=ended.sequence.take(index),
        sent_at_ns=packets.sent_at_ns.take(packet),
        on_air_at_ns=packets.on_air_at_ns.take(packet),
        final_at_ns=ended.final_at_ns.take(index),
        fate=ended.fate.take(index),
        size_bytes=packets.payloads.sizes.take(packet),
        tag=packets.tag.take(packet),
        rssi_dbm=ended.rssi_dbm.take(index) if has_strength else None,
        payload=packet,
        payloads=packets.payloads,
    )


def in_arena(row: IntArray, robots: int) -> IntArray:
    """Indices within their arena of robot rows; numpy divides several at a time, but finds remainders one by one."""
    return row - row // robots * robots


def departed(ended: Links, packets: Transmissions, robots: int) -> Departed:
    """The packets that left their sender's radio: each has one row for the rest of its receivers."""
    index = np.flatnonzero(ended.receiver == THE_REST)
    packet, row = ended.packet.take(index), ended.sender.take(index)
    arena = row // robots
    return Departed(
        arena=arena,
        sender=row - arena * robots,
        to=packets.to.take(packet),
        sequence=ended.sequence.take(index),
        intended=packets.intended.take(packet),
        out_of_range=np.where(ended.fate.take(index) == OUT_OF_RANGE, ended.receivers.take(index), 0),
        fate=packets.fate.take(packet),
        on_air_at_ns=packets.on_air_at_ns.take(packet),
        off_air_at_ns=packets.off_air_at_ns.take(packet),
    )


def compacted(index: IntArray, rows: int) -> tuple[IntArray, IntArray]:
    """Which of `rows` rows are referred to, rising, and `index` renumbered to refer to these only."""
    used = np.zeros(rows, np.bool_)
    used[index] = True
    return np.flatnonzero(used), (np.cumsum(used) - 1).take(index)
