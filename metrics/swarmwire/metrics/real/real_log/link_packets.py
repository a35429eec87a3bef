"""The fate of every packet on every link, from the packets sent and received.

A packet that a robot sent and that another, which it was meant for, did not hear was lost. Of a robot whose own log is
not there, or that was killed before it had written all, what others received shows what it sent: numbers between that
are missing everywhere were sent, too. Numbers start again where they fall by far: the agent was started again.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.base.errors import BadInput
from swarmwire.metrics.real.real_log.robot_log import LoggedReceptions, LoggedTransmissions

ALL, UNKNOWN = -1, -2  # of `to`: all others; a robot that is not of these
REORDERED = 50  # numbers that a packet may come late by
MAX_LOST = 10_000_000
USUAL = 0.99  # share of packets
_EPOCH = 2**40  # numbers that a start of an agent may use


@dataclass(frozen=True)
class Node:
    """A robot as far as its radio goes."""

    name: str
    sent: LoggedTransmissions | None  # None: its log is not there
    received: LoggedReceptions | None  # None: its log is not there
    span_s: tuple[float, float] | None  # in which it listened; None: only what it received tells


@dataclass(frozen=True)
class OwnPackets:
    """The packets of one robot, in the order of their numbers."""

    key: IntArray  # (n,) rising: the number, and which start of the agent it is of
    sequence: IntArray  # (n,)
    sent_s: FloatArray  # (n,) rising, as far as clocks are right
    to: IntArray  # (n,) a place in the names, ALL or UNKNOWN
    size_bytes: IntArray  # (n,)
    tag: IntArray  # (n,)
    too_large: BoolArray  # (n,) never on air
    starts_s: FloatArray  # (k,) when numbers started anew


@dataclass(frozen=True)
class LinkPackets:
    """A row per packet and robot that it was meant for, link after link, by number within each."""

    sender: IntArray  # (n,) place in the names
    receiver: IntArray  # (n,)
    to: IntArray  # (n,)
    sequence: IntArray  # (n,)
    sent_s: FloatArray  # (n,)
    received_s: FloatArray  # (n,) NaN: lost
    latency_s: FloatArray  # (n,) NaN: lost, or not known
    distance_m: FloatArray  # (n,) as the receiver noted it; NaN: not known
    size_bytes: IntArray  # (n,)
    tag: IntArray  # (n,)

    def rows(self, index: Any) -> "LinkPackets":
        """Some of the rows."""
        return LinkPackets(**{of.name: getattr(self, of.name)[index] for of in fields(self)})


def own_packets(nodes: Sequence[Node], where: str) -> tuple[OwnPackets, ...]:
    """What each of these robots sent; BadInput if numbers leave out more than can be."""
    place = {node.name: i for i, node in enumerate(nodes)}
    tags: dict[str, int] = {}
    return tuple(_own(node, nodes, place, tags, where) for node in nodes)


def link_packets(nodes: Sequence[Node], own: Sequence[OwnPackets]) -> LinkPackets:
    """Their fates, for each robot whose log is there."""
    parts = [
        _link(nodes[sender], sender, packets, node, receiver)
        for sender, packets in enumerate(own)
        for receiver, node in enumerate(nodes)
        if node.received is not None and receiver != sender
    ]
    columns: dict[str, Any] = {
        of.name: np.concatenate([getattr(part, of.name) for part in parts]) if parts else np.zeros(0, np.int64)
        for of in fields(LinkPackets)
    }
    return LinkPackets(**columns)


def usual_latency_s(links: LinkPackets) -> float:
    """How late packets are that are not unusually late: 99 of 100 are received sooner; 0 if unknown."""
    known = links.latency_s[np.isfinite(links.latency_s)]
    return max(float(np.quantile(known, USUAL)), 0.0) if len(known) else 0.0


def restarts_s(time_s: FloatArray, sequence: IntArray) -> FloatArray:
    """When numbers started again, (k,): between the last packet before and the first after."""
    order = np.argsort(time_s, kind="stable")
    at_s, falls = time_s[order], np.flatnonzero(np.diff(sequence[order]) < -REORDERED)
    return 0.5 * (at_s[falls] + at_s[falls + 1])


def _own(node: Node, nodes: Sequence[Node], place: Mapping[str, int], tags: dict[str, int], where: str) -> OwnPackets:
    parts = [] if node.sent is None else [_columns(node.sent, node.sent.time_s, place, tags, node.sent.too_large)]
    for other in nodes:
        received = None if other.received is None else other.received.by_sender.get(node.name)
        if received is not None and other.name != node.name:
            parts.append(_columns(received, received.sent_s, place, tags, np.zeros(len(received.sequence), np.bool_)))
    if not parts:
        parts = [(np.zeros(0, np.int64),) * 6]
    sequence, sent_s, to, size, tag, large = (np.concatenate(column) for column in zip(*parts, strict=True))
    numbered = slice(None) if node.sent is None else slice(len(node.sent.sequence))  # its own log knows best
    starts_s = restarts_s(sent_s[numbered], sequence[numbered])
    key, first = np.unique(sequence + _EPOCH * np.searchsorted(starts_s, sent_s), return_index=True)
    found = OwnPackets(key, sequence[first], sent_s[first], to[first], size[first], tag[first], large[first], starts_s)
    return found if node.sent is not None else _filled(found, f"{where}: {node.name}")


def _columns(
    of: LoggedTransmissions | LoggedReceptions,
    sent_s: FloatArray,
    place: Mapping[str, int],
    tags: dict[str, int],
    too_large: BoolArray,
) -> tuple[Any, ...]:
    to = np.array([ALL if not name else place.get(name, UNKNOWN) for name in of.to], np.int64)
    tag = np.array([tags.setdefault(name, len(tags)) for name in of.tag], np.int64)
    return of.sequence, sent_s, to, of.size_bytes, tag, too_large


def _filled(of: OwnPackets, where: str) -> OwnPackets:
    """With the packets that no robot received, as if sent evenly between those around them, to all."""
    missed = np.where(np.diff(of.key // _EPOCH) == 0, np.diff(of.key) - 1, 0) if len(of.key) else of.key
    if missed.sum() > MAX_LOST:
        raise BadInput(where, "seq", f"leaves {missed.sum()} packets out; expected {MAX_LOST} lost in all at most")
    if not missed.sum():
        return of
    start = np.repeat(of.key[:-1], missed)
    nth = np.arange(len(start)) - np.repeat(np.cumsum(missed) - missed, missed) + 1
    lost = start + nth
    key = np.concatenate([of.key, lost])
    order = np.argsort(key)
    sent_s = np.concatenate([of.sent_s, np.interp(lost, of.key, of.sent_s)])[order]

    def with_lost(column: Any, value: int) -> Any:
        return np.concatenate([column, np.full(len(lost), value, column.dtype)])[order]

    return OwnPackets(
        key[order],
        key[order] % _EPOCH,
        sent_s,
        with_lost(of.to, ALL),
        with_lost(of.size_bytes, 0),
        with_lost(of.tag, 0),
        with_lost(of.too_large, 0),
        of.starts_s,
    )


def _link(sender_node: Node, sender: int, packets: OwnPackets, node: Node, receiver: int) -> LinkPackets:
    assert node.received is not None
    received = node.received.by_sender.get(sender_node.name, _NOTHING)
    span = node.span_s or _span_s(received.sent_s)
    # Its own log knows whom a packet was meant for; without it all that could be received counts.
    meant = (packets.to == ALL) | (packets.to == receiver) | (sender_node.sent is None)
    listened = (packets.sent_s >= span[0]) & (packets.sent_s <= span[1])
    kept = meant & listened & ~packets.too_large
    # Every packet received is among those of its sender.
    at = np.searchsorted(packets.key, received.sequence + _EPOCH * np.searchsorted(packets.starts_s, received.sent_s))

    def by_packet(column: FloatArray) -> FloatArray:
        values = np.full(len(packets.key), np.nan)
        values[at[::-1]] = column[::-1]  # of one that came twice the first counts
        return values[kept]

    count = int(kept.sum())
    return LinkPackets(
        np.full(count, sender),
        np.full(count, receiver),
        packets.to[kept],
        packets.sequence[kept],
        packets.sent_s[kept],
        by_packet(received.time_s),
        by_packet(received.latency_s),
        by_packet(received.distance_m),
        packets.size_bytes[kept],
        packets.tag[kept],
    )


def _span_s(time_s: FloatArray) -> tuple[float, float]:
    return (float(time_s.min()), float(time_s.max())) if len(time_s) else (np.inf, -np.inf)


_NONE = np.zeros(0)
_WHOLE = np.zeros(0, np.int64)
_WORDS = np.zeros(0, np.str_)
_NOTHING = LoggedReceptions(_NONE, _WORDS, _WHOLE, _WORDS, _WHOLE, _WORDS, _NONE, _NONE)
