"""The radio of real robots as observers of a run see one: tallies and fates, tick by tick."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.clock import NS_PER_S
from swarmwire.comms.packets import FATE_NAMES, Fate
from swarmwire.comms.truth import NO_ROBOT, PacketCounts, ReceptionRecords
from swarmwire.metrics.real_log.link_packets import (
    EVERYBODY,
    LinkPackets,
    Node,
    OwnPackets,
    link_packets,
    own_packets,
    usual_latency_s,
)
from swarmwire.metrics.real_log.real_logs import RealLogs
from swarmwire.metrics.real_log.time_base import TimeBase

AFTER_ALL_NS = 2**62


@dataclass(frozen=True)
class RadioTruth:
    """What the radio did by each tick. Packets count that were sent after the first tick began."""

    tallies: tuple[PacketCounts, ...]  # one per tick
    finished: tuple[ReceptionRecords, ...]  # one per tick


def radio_truth(logs: RealLogs, base: TimeBase) -> RadioTruth:
    """A loss is final as the packet is sent: nobody knows when it would have been received."""
    nodes = [Node(robot.name, robot.sent, robot.received, (base.start_s, base.end_s)) for robot in logs.robots]
    own = own_packets(nodes, logs.where)
    rows = _rows(link_packets(nodes, own), own, len(nodes), base)
    edges_ns = (base.time_s - base.start_s) * NS_PER_S
    sent_tick = np.searchsorted(edges_ns, rows.sent_at_ns)
    final_tick = np.searchsorted(edges_ns, rows.final_at_ns)
    order = np.lexsort((rows.final_at_ns, final_tick))
    ends = np.searchsorted(final_tick[order], np.arange(base.ticks + 1))
    tallies = _tallies(rows, _sent_ticks(own, base), sent_tick, final_tick, base.ticks)
    finished = tuple(_picked(rows, order[ends[tick] : ends[tick + 1]]) for tick in range(base.ticks))
    return RadioTruth(tallies, finished)


def under_way(tallies: Sequence[PacketCounts]) -> PacketCounts:
    """What was sent in these ticks, from the first on, and has no fate in them."""
    fates = np.zeros((1, len(FATE_NAMES)), np.int64)
    fates[0, Fate.IN_FLIGHT] = sum(int(tally.intended.sum() - tally.fates.sum()) for tally in tallies)
    none = np.zeros(1, np.int64)
    return PacketCounts(none, none, none, fates)


def _rows(links: LinkPackets, own: tuple[OwnPackets, ...], robots: int, base: TimeBase) -> ReceptionRecords:
    """All that was sent in time, a row per packet and receiver; of one that was too large one for all."""
    received = np.isfinite(links.received_s)
    large = [(sender, of, np.flatnonzero(of.too_large & _within(of.sent_s, base))) for sender, of in enumerate(own)]
    zeros = np.zeros(sum(len(rows) for _, _, rows in large), np.int64)

    def with_large(column: IntArray, of_large: list[IntArray]) -> IntArray:
        return np.concatenate([column.astype(np.int64), *of_large])

    to = with_large(links.to, [of.to[rows] for _, of, rows in large])
    sent_ns = with_large(_ns(links.sent_s, base), [_ns(of.sent_s[rows], base) for _, of, rows in large])
    # A packet cannot arrive before it is sent, whatever clocks say.
    final_ns = np.maximum(_ns(np.where(received, links.received_s, base.start_s), base), sent_ns[: len(received)])
    # Packets that may still have been received after the last tick are not lost.
    late = ~received & (links.sent_s > base.end_s - usual_latency_s(links))
    final_ns[late] = AFTER_ALL_NS
    everybody = [np.where(of.to[rows] == EVERYBODY, robots - 1, of.to[rows] >= 0) for _, of, rows in large]
    return ReceptionRecords(
        arena=np.zeros(len(to), np.int64),
        sender=with_large(links.sender, [np.full(len(rows), sender) for sender, _, rows in large]),
        receiver=with_large(links.receiver, [zeros + NO_ROBOT]),
        receivers=with_large(np.ones(len(received), np.int64), everybody),
        to=to,
        sequence=with_large(links.sequence, [of.sequence[rows] for _, of, rows in large]),
        sent_at_ns=sent_ns,
        on_air_at_ns=sent_ns,
        final_at_ns=with_large(final_ns, [sent_ns[len(received) :]]),
        fate=with_large(np.where(received, Fate.RECEIVED, Fate.LOST), [zeros + Fate.TOO_LARGE]),
        size_bytes=with_large(links.size_bytes, [of.size_bytes[rows] for _, of, rows in large]),
        tag=with_large(links.tag, [of.tag[rows] for _, of, rows in large]),
    )


def _tallies(
    rows: ReceptionRecords, sent: IntArray, sent_tick: IntArray, final_tick: IntArray, ticks: int
) -> tuple[PacketCounts, ...]:
    intended = np.bincount(sent_tick, rows.receivers, minlength=ticks + 1).astype(np.int64)
    fates = np.zeros((ticks + 1, len(FATE_NAMES)), np.int64)
    np.add.at(fates, (np.minimum(final_tick, ticks), rows.fate), rows.receivers)
    # A real network knows no range: all that a packet on air was meant for count as within it.
    in_range = fates[:, Fate.RECEIVED] + fates[:, Fate.LOST]
    return tuple(
        PacketCounts(sent[t : t + 1], intended[t : t + 1], in_range[t : t + 1], fates[t : t + 1]) for t in range(ticks)
    )


def _sent_ticks(own: tuple[OwnPackets, ...], base: TimeBase) -> IntArray:
    """Packets that were handed to radios by each tick, (ticks,)."""
    sent_s = np.concatenate([of.sent_s[_within(of.sent_s, base)] for of in own])
    tick = np.searchsorted((base.time_s - base.start_s) * NS_PER_S, _ns(sent_s, base))
    return np.bincount(tick, minlength=base.ticks)[: base.ticks]


def _picked(rows: ReceptionRecords, at: IntArray) -> ReceptionRecords:
    columns: dict[str, Any] = {of.name: getattr(rows, of.name) for of in fields(rows)}
    picked: dict[str, Any] = {name: None if column is None else column[at] for name, column in columns.items()}
    return ReceptionRecords(**picked)


def _within(time_s: FloatArray, base: TimeBase) -> BoolArray:
    return (time_s >= base.start_s) & (time_s <= base.end_s)


def _ns(time_s: FloatArray, base: TimeBase) -> IntArray:
    """Since the first tick began."""
    return np.round((time_s - base.start_s) * NS_PER_S).astype(np.int64)
