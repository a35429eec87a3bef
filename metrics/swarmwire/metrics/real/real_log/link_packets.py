"""The fate of every packet on every link, from the packets sent and received.

A packet that a robot sent and an intended receiver did not receive was lost. If the log of a robot is missing, or
incomplete since the robot was killed, the packets that others received show what it sent: missing sequence numbers
between them were sent, too. A large decrease of the numbers is a restart of the agent.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.base.errors import BadInput
from swarmwire.metrics.real.real_log.robot_log import LoggedReceptions, LoggedTransmissions

ALL, UNKNOWN = -1, -2  # values of `to`: all others; a robot outside the swarm
REORDERED = 50  # greatest decrease of sequence numbers by reordering
MAX_LOST = 10_000_000
USUAL = 0.99  # quantile of usual latencies
_EPOCH = 2**40  # sequence numbers per start of an agent


@dataclass(frozen=True)
class Node:
    """The radio of a robot."""

    name: str
    sent: LoggedTransmissions | None  # None: without a log
    received: LoggedReceptions | None  # None: without a log
    span_s: tuple[float, float] | None  # time of listening; None: from the first to the last reception


@dataclass(frozen=True)
class SenderPackets:
    """The packets of a sender, by sequence number."""

    key: IntArray  # (n,) ascending: start of the agent and sequence number
    sequence: IntArray  # (n,)
    sent_s: FloatArray  # (n,) ascending with correct clocks
    to: IntArray  # (n,) index of a robot, ALL or UNKNOWN
    size_bytes: IntArray  # (n,)
    tag: IntArray  # (n,)
    too_large: BoolArray  # (n,) never on air
    starts_s: FloatArray  # (k,) times of restarts


@dataclass(frozen=True)
class LinkPackets:
    """A row per packet and intended receiver, link after link, by sequence number within each."""

    sender: IntArray  # (n,) index of a robot
    receiver: IntArray  # (n,)
    to: IntArray  # (n,)
    sequence: IntArray  # (n,)
    sent_s: FloatArray  # (n,)
    received_s: FloatArray  # (n,) NaN: lost
    latency_s: FloatArray  # (n,) NaN: lost or unknown
    distance_m: FloatArray  # (n,) recorded by the receiver; NaN: unknown
    size_bytes: IntArray  # (n,)
    tag: IntArray  # (n,)

    def rows(self, index: Any) -> "LinkPackets":
        """Return the selected rows."""
        return LinkPackets(**{field.name: getattr(self, field.name)[index] for field in fields(self)})


def sender_packets(nodes: Sequence[Node], where: str) -> tuple[SenderPackets, ...]:
    """Return the packets that each robot sent; BadInput if sequence numbers leave out more than MAX_LOST."""
    index = {node.name: i for i, node in enumerate(nodes)}
    tags: dict[str, int] = {}
    return tuple(_packets_of(node, nodes, index, tags, where) for node in nodes)


def link_packets(nodes: Sequence[Node], senders: Sequence[SenderPackets]) -> LinkPackets:
    """Return the fates of the packets at each robot with a log."""
    parts = [
        _link(nodes[sender], sender, packets, node, receiver)
        for sender, packets in enumerate(senders)
        for receiver, node in enumerate(nodes)
        if node.received is not None and receiver != sender
    ]
    columns: dict[str, Any] = {
        field.name: np.concatenate([getattr(part, field.name) for part in parts]) if parts else np.zeros(0, np.int64)
        for field in fields(LinkPackets)
    }
    return LinkPackets(**columns)


def usual_latency_s(links: LinkPackets) -> float:
    """Return the latency that 99 of 100 packets do not exceed; 0 if unknown."""
    finite_s = links.latency_s[np.isfinite(links.latency_s)]
    return max(float(np.quantile(finite_s, USUAL)), 0.0) if len(finite_s) else 0.0


def restarts_s(time_s: FloatArray, sequence: IntArray) -> FloatArray:
    """Return the times of restarts, (k,), each midway between the last packet before and the first packet after."""
    order = np.argsort(time_s, kind="stable")
    time_s, falls = time_s[order], np.flatnonzero(np.diff(sequence[order]) < -REORDERED)
    return 0.5 * (time_s[falls] + time_s[falls + 1])


def _packets_of(
    node: Node, nodes: Sequence[Node], index: Mapping[str, int], tags: dict[str, int], where: str
) -> SenderPackets:
    parts = [] if node.sent is None else [_columns(node.sent, node.sent.time_s, index, tags, node.sent.too_large)]
    for other in nodes:
        received = None if other.received is None else other.received.by_sender.get(node.name)
        if received is not None and other.name != node.name:
            parts.append(_columns(received, received.sent_s, index, tags, np.zeros(len(received.sequence), np.bool_)))
    if not parts:
        parts = [(np.zeros(0, np.int64),) * 6]
    sequence, sent_s, to, size, tag, large = (np.concatenate(column) for column in zip(*parts, strict=True))
    numbered = slice(None) if node.sent is None else slice(len(node.sent.sequence))  # prefer the sender's log
    starts_s = restarts_s(sent_s[numbered], sequence[numbered])
    key, first = np.unique(sequence + _EPOCH * np.searchsorted(starts_s, sent_s), return_index=True)
    packets = SenderPackets(
        key=key,
        sequence=sequence[first],
        sent_s=sent_s[first],
        to=to[first],
        size_bytes=size[first],
        tag=tag[first],
        too_large=large[first],
        starts_s=starts_s,
    )
    return packets if node.sent is not None else _filled(packets, f"{where}: {node.name}")


def _columns(
    table: LoggedTransmissions | LoggedReceptions,
    sent_s: FloatArray,
    index: Mapping[str, int],
    tags: dict[str, int],
    too_large: BoolArray,
) -> tuple[Any, ...]:
    to = np.array([ALL if not name else index.get(name, UNKNOWN) for name in table.to], np.int64)
    tag = np.array([tags.setdefault(name, len(tags)) for name in table.tag], np.int64)
    return table.sequence, sent_s, to, table.size_bytes, tag, too_large


def _filled(packets: SenderPackets, where: str) -> SenderPackets:
    """Add the packets that no robot received, as sent to all, evenly between their neighbours."""
    if not len(packets.key):
        return packets
    missed = np.where(np.diff(packets.key // _EPOCH) == 0, np.diff(packets.key) - 1, 0)
    if missed.sum() > MAX_LOST:
        expected = f"leaves {missed.sum()} packets out; expected at most {MAX_LOST} lost packets in total"
        raise BadInput(where, "seq", expected)
    if not missed.sum():
        return packets
    start = np.repeat(packets.key[:-1], missed)
    nth = np.arange(len(start)) - np.repeat(np.cumsum(missed) - missed, missed) + 1
    lost = start + nth
    key = np.concatenate([packets.key, lost])
    order = np.argsort(key)
    sent_s = np.concatenate([packets.sent_s, np.interp(lost, packets.key, packets.sent_s)])[order]

    def with_lost(column: Any, value: int) -> Any:
        return np.concatenate([column, np.full(len(lost), value, column.dtype)])[order]

    return SenderPackets(
        key[order],
        key[order] % _EPOCH,
        sent_s,
        with_lost(packets.to, ALL),
        with_lost(packets.size_bytes, 0),
        with_lost(packets.tag, 0),
        with_lost(packets.too_large, 0),
        packets.starts_s,
    )


def _link(sender_node: Node, sender: int, packets: SenderPackets, node: Node, receiver: int) -> LinkPackets:
    assert node.received is not None
    received = node.received.by_sender.get(sender_node.name, _NO_RECEPTIONS)
    span = node.span_s or _span_s(received.sent_s)
    # Only the sender's log knows the intended receivers; without it, every packet counts at every receiver.
    intended = (packets.to == ALL) | (packets.to == receiver) | (sender_node.sent is None)
    listened = (packets.sent_s >= span[0]) & (packets.sent_s <= span[1])
    selected = intended & listened & ~packets.too_large
    # Every received packet is among the packets of its sender.
    row = np.searchsorted(packets.key, received.sequence + _EPOCH * np.searchsorted(packets.starts_s, received.sent_s))

    def by_packet(column: FloatArray) -> FloatArray:
        values = np.full(len(packets.key), np.nan)
        values[row[::-1]] = column[::-1]  # the first reception of duplicates counts
        return values[selected]

    count = int(selected.sum())
    return LinkPackets(
        np.full(count, sender),
        np.full(count, receiver),
        packets.to[selected],
        packets.sequence[selected],
        packets.sent_s[selected],
        by_packet(received.time_s),
        by_packet(received.latency_s),
        by_packet(received.distance_m),
        packets.size_bytes[selected],
        packets.tag[selected],
    )


def _span_s(time_s: FloatArray) -> tuple[float, float]:
    return (float(time_s.min()), float(time_s.max())) if len(time_s) else (np.inf, -np.inf)


_NO_FLOATS, _NO_INTEGERS, _NO_TEXTS = np.zeros(0), np.zeros(0, np.int64), np.zeros(0, np.str_)
_NO_RECEPTIONS = LoggedReceptions(
    time_s=_NO_FLOATS,
    sender=_NO_TEXTS,
    sequence=_NO_INTEGERS,
    to=_NO_TEXTS,
    size_bytes=_NO_INTEGERS,
    tag=_NO_TEXTS,
    latency_s=_NO_FLOATS,
    distance_m=_NO_FLOATS,
)
