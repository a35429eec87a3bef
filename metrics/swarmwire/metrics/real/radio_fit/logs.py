"""Logs of packets between robots, as CSV or Parquet: of a radio, with RSSI, or of a network, without RSSI."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import polars as pl

from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.metrics.real.radio_fit.losses import LossSequences
from swarmwire.metrics.real.real_log.link_packets import (
    LinkPackets,
    Node,
    link_packets,
    sender_packets,
    usual_latency_s,
)
from swarmwire.metrics.real.real_log.real_logs import RealLogs, in_step
from swarmwire.metrics.real.real_log.robot_log import LogTable, RealRobotLog, received_packets
from swarmwire.metrics.real.real_log.time_base import posed_span_s, poses_at
from swarmwire.metrics.records.table_file import MeasuredTable, corruption_errors

NETWORK_COLUMNS = ("t_s", "tx", "rx", "seq")
RADIO_COLUMNS = (*NETWORK_COLUMNS, "rssi_dbm")
ENDS = ("tx_x_m", "tx_y_m", "rx_x_m", "rx_y_m")
DISTANCE = "distance_m"
MAX_LOST = 10_000_000


@dataclass(frozen=True)
class PacketLog:
    """A row per packet that was received, or recorded as lost; sorted by link, then by sequence number.

    Gaps in the sequence numbers of a link are lost packets, too.
    """

    links: tuple[tuple[str, str], ...]  # names of sender and receiver
    link: IntArray  # (n,) index in `links`
    time_s: FloatArray  # (n,) ascending within a link
    sequence: IntArray  # (n,) ascending within a link
    rssi_dbm: FloatArray  # (n,) NaN: lost
    distance_m: FloatArray  # (n,) NaN: unknown, for lost packets only
    ends_m: FloatArray | None  # (n, 4) x and y of sender and receiver; None: the log has no positions

    @cached_property
    def received(self) -> BoolArray:
        """True for received packets, (n,)."""
        return np.isfinite(self.rssi_dbm)

    @cached_property
    def opens(self) -> BoolArray:
        """True for the first row of each link, (n,)."""
        return np.diff(self.link, prepend=-1) != 0

    @cached_property
    def gaps(self) -> IntArray:
        """Numbers of lost packets without a row right before each row, (n,)."""
        missed = np.diff(self.sequence, prepend=0) - 1
        return np.where(self.opens, 0, missed)

    @cached_property
    def last_distance_m(self) -> FloatArray:
        """Distances (n,), with unknown ones replaced by the link's latest known distance; NaN before the first."""
        row = np.arange(len(self.link))
        latest: IntArray = np.maximum.accumulate(np.where(np.isfinite(self.distance_m), row, -1))
        same_link = (latest >= 0) & (self.link[latest] == self.link)
        return np.where(same_link, self.distance_m[latest], np.nan)

    def within(self, distance_m: float) -> "PacketLog":
        """Return the rows up to a distance; after rows beyond it, a link continues as another link."""
        near = self.last_distance_m <= distance_m
        far_since_start = np.cumsum(~near)
        # A link's rows with no far row between them stay together.
        spell = np.stack([self.link, far_since_start])[:, near]
        starts = np.any(np.diff(spell, axis=1, prepend=-1) != 0, axis=0)
        first: list[int] = self.link[near][starts].tolist()
        return PacketLog(
            tuple(self.links[i] for i in first),
            np.cumsum(starts) - 1,
            self.time_s[near],
            self.sequence[near],
            self.rssi_dbm[near],
            self.distance_m[near],
            None if self.ends_m is None else self.ends_m[near],
        )


def read_log(path: Path) -> PacketLog:
    """Read a log; its links are in the order of their names.

    Columns: t_s, tx, rx, seq, rssi_dbm (empty: the packet was lost), and tx_x_m, tx_y_m, rx_x_m, rx_y_m or distance_m
    (may be empty for lost packets). The rows of a link are in the order of time, links in any order. BadInput for
    another order, repeated sequence numbers and invalid values.
    """
    table = MeasuredTable(path)
    table.need(RADIO_COLUMNS)
    time_s, sequence, rssi_dbm = (table.numbers(name) for name in ("t_s", "seq", "rssi_dbm"))
    table.refuse_where(np.isnan(time_s), "t_s", "expected a time in s")
    table.refuse_where(~(np.abs(sequence) < 2.0**53) | (sequence % 1 != 0), "seq", "expected a whole number")
    names = list(zip(table.texts("tx"), table.texts("rx"), strict=True))
    table.refuse_where(np.array([tx == rx for tx, rx in names]), "rx", "expected another robot than tx")
    lost = np.isnan(rssi_dbm)
    ends_m = _ends(table, lost)
    distance_m = _distance(table, ends_m, lost)
    links = tuple(sorted(set(names)))
    index = {link: i for i, link in enumerate(links)}
    link = np.array([index[name] for name in names], np.int64)
    order: IntArray = np.argsort(link, kind="stable")
    _refuse_disorder(table, order, link, time_s, sequence)
    return PacketLog(
        links,
        link[order],
        time_s[order],
        sequence.astype(np.int64)[order],
        rssi_dbm[order],
        distance_m[order],
        None if ends_m is None else ends_m[order],
    )


def _ends(table: MeasuredTable, lost: BoolArray) -> FloatArray | None:
    """Return positions (rows, 4) of sender and receiver in m; None if the file has no positions."""
    if not any(name in table.columns for name in ENDS):
        return None
    table.need(ENDS)
    for name in ENDS:
        table.refuse_where(np.isnan(table.numbers(name)) & ~lost, name, "expected the position of a received packet")
    return np.stack([table.numbers(name) for name in ENDS], axis=1)


def _distance(table: MeasuredTable, ends_m: FloatArray | None, lost: BoolArray) -> FloatArray:
    """Return distances of sender and receiver in m, (rows,), from positions or from DISTANCE."""
    if ends_m is not None:
        distance_m: FloatArray = np.hypot(ends_m[:, 2] - ends_m[:, 0], ends_m[:, 3] - ends_m[:, 1])
        table.refuse_where(distance_m <= 0.0, "rx_x_m", "expected different positions of sender and receiver")
        return distance_m
    if DISTANCE not in table.columns:
        raise table.refused(DISTANCE, f"is missing, and so are the positions {', '.join(ENDS)}; expected either")
    distance_m = table.numbers(DISTANCE)
    table.refuse_where((np.isnan(distance_m) & ~lost) | (distance_m <= 0.0), DISTANCE, "expected more than 0 m")
    return distance_m


def _refuse_disorder(
    table: MeasuredTable, order: IntArray, link: IntArray, time_s: FloatArray, sequence: FloatArray
) -> None:
    """Raise BadInput unless time and sequence number rise from row to row of each link."""
    same = np.diff(link[order]) == 0
    steps = np.diff(sequence[order])
    for wrong, column, expected in (
        (steps == 0, "seq", "comes twice on this link; expected each number once"),
        (steps < 0, "seq", "falls on this link; expected numbers that rise with time"),
        (np.diff(time_s[order]) <= 0, "t_s", "does not rise on this link; expected its rows in the order of time"),
    ):
        table.refuse_where(_rows(order, same & wrong), column, expected)
    gaps = np.where(same, steps - 1.0, 0.0)
    if gaps.sum() > MAX_LOST:
        widest = _rows(order, gaps == gaps.max())
        expected = f"leaves {gaps.max():.0f} packets out; expected at most {MAX_LOST} lost packets in total"
        table.refuse_where(widest, "seq", expected)


def _rows(order: IntArray, wrong: AnyArray) -> BoolArray:
    """Return flags of the file's rows, (rows,), from flags of the steps between sorted rows, (rows - 1,)."""
    flags = np.zeros(len(order), np.bool_)
    flags[order[1:][wrong]] = True
    return flags


def loss_sequences(log: PacketLog) -> LossSequences:
    """Return the losses of a log; packets in gaps count as sent evenly between the neighbouring rows.

    Packets before a link's first row and after its last are unknown.
    """
    repeat = log.gaps + 1
    row = np.repeat(np.arange(len(log.link)), repeat)
    step_s = np.diff(log.time_s, prepend=0.0) / repeat
    since_s = step_s[row]
    last = np.cumsum(repeat) - 1
    since_s[last[log.opens]] = np.inf  # an opening row has no gap before it
    lost = np.ones(len(row), np.bool_)
    lost[last] = ~log.received
    return LossSequences(log.link[row], since_s, lost)


@dataclass(frozen=True)
class NetworkLog:
    """Packets of all links, link after link, by number within each."""

    names: tuple[str, ...]
    packets: LinkPackets
    distance_m: FloatArray  # (n,) distance at sending; NaN: unknown
    notes: tuple[str, ...]

    @property
    def lost(self) -> BoolArray:
        """True for lost packets, (n,)."""
        return np.isnan(self.packets.received_s)

    @property
    def has_distances(self) -> bool:
        """True if any packet's distance is known, since the robots had a tracker."""
        return bool(np.isfinite(self.distance_m).any())

    def within(self, distance_m: float) -> "NetworkLog":
        """Return the packets sent over at most this distance."""
        near = self.distance_m <= distance_m
        return replace(self, packets=self.packets.rows(near), distance_m=self.distance_m[near])

    def sequences(self, selected: BoolArray) -> LossSequences:
        """Return the losses of the selected packets (n,), in the order of time within each link."""
        packets = self.packets.rows(selected)
        link = packets.sender * len(self.names) + packets.receiver
        order = np.lexsort((packets.sent_s, link))
        link, sent_s, lost = link[order], packets.sent_s[order], self.lost[selected][order]
        opens = np.diff(link, prepend=-1) != 0
        since_s = np.where(opens, np.inf, np.maximum(np.diff(sent_s, prepend=0.0), 1e-9))
        return LossSequences(np.cumsum(opens) - 1, since_s, lost)


def is_network_table(path: Path) -> bool:
    """Return True if a file is a CSV of received packets without RSSI; False if it cannot be read."""
    if path.suffix.lower() != ".csv":
        return False
    try:
        with path.open("rb") as file:  # polars would read a path such as "log[1].csv" as a pattern
            columns = pl.read_csv(file, n_rows=0).columns  # spreadsheets write a byte-order mark, R quotes names
    except (OSError, *corruption_errors()):
        return False
    return set(NETWORK_COLUMNS) <= set(columns) and "rssi_dbm" not in columns


def network_log_of_table(path: Path) -> NetworkLog:
    """Read a table of received packets; packets before a link's first and after its last are unknown.

    Columns: t_s, tx, rx, seq; optional: to, latency_s, distance_m. BadInput for invalid values.
    """
    table = LogTable(path, NETWORK_COLUMNS)
    notes = ("half a line at the end was dropped",) if table.half_line else ()
    received, receivers = received_packets(table), np.array(table.texts("rx"), np.str_)
    table.refuse_where(received.sender == receivers, "rx", "expected another robot than tx")
    names = sorted({*received.sender.tolist(), *receivers.tolist()})
    nodes = [Node(name, None, received.rows(np.flatnonzero(receivers == name)), None) for name in names]
    return _network_log(nodes, [None] * len(nodes), str(path), notes)


def network_log_of_robots(logs: RealLogs) -> NetworkLog:
    """Return the packets of all robots' logs, by a common clock, and those received from robots without logs."""
    logs = in_step(logs)
    by_name: dict[str, RealRobotLog] = dict(zip(logs.names, logs.robots, strict=True))
    robots = [by_name.get(name) for name in logs.robots[0].about.robots]
    nodes = [
        Node(name, None, None, None) if robot is None else Node(name, robot.sent, robot.received, _span_s(robot))
        for name, robot in zip(logs.robots[0].about.robots, robots, strict=True)
    ]
    return _network_log(nodes, robots, logs.where, logs.notes)


def _span_s(robot: RealRobotLog) -> tuple[float, float] | None:
    steps_s = robot.steps.time_s
    return (float(steps_s[0]), float(steps_s[-1])) if len(steps_s) else None


def _network_log(
    nodes: Sequence[Node], robots: Sequence[RealRobotLog | None], where: str, notes: tuple[str, ...]
) -> NetworkLog:
    packets = link_packets(nodes, sender_packets(nodes, where))
    ends_s = np.array([node.span_s[1] if node.span_s else np.inf for node in nodes])
    contact_s = _contact_s(packets, len(nodes))
    begun = packets.sent_s >= np.maximum(contact_s[packets.sender], contact_s[packets.receiver])
    # Packets that may have been received after a log's end are not lost.
    final = np.isfinite(packets.received_s) | (packets.sent_s <= ends_s[packets.receiver] - usual_latency_s(packets))
    packets = packets.rows(begun & final)
    return NetworkLog(tuple(node.name for node in nodes), packets, _distances_m(packets, robots), notes)


def _contact_s(packets: LinkPackets, robots: int) -> FloatArray:
    """Return the time of each robot's first packet, sent or received, that arrived, (robots,); -inf: none arrived.

    Earlier packets are not informative: agents start one after the other, and connect for some seconds.
    """
    received, first_s = np.isfinite(packets.received_s), np.full(robots, np.inf)
    for end in (packets.sender, packets.receiver):
        np.minimum.at(first_s, end[received], packets.sent_s[received])
    return np.where(np.isfinite(first_s), first_s, -np.inf)


def _distances_m(packets: LinkPackets, robots: Sequence[RealRobotLog | None]) -> FloatArray:
    """Return distances (n,) from the poses of both robots at sending, else interpolated from the receivers' records."""
    distance_m = np.full(len(packets.sender), np.nan)
    link = packets.sender * max(len(robots), 1) + packets.receiver
    for number in np.unique(link):
        rows = np.flatnonzero(link == number)
        sender, receiver = robots[int(packets.sender[rows[0]])], robots[int(packets.receiver[rows[0]])]
        sent_s = packets.sent_s[rows]
        recorded = np.isfinite(packets.distance_m[rows])
        if sender and receiver and posed_span_s(sender) and posed_span_s(receiver):
            difference_m = poses_at(sender, sent_s)[:, :2] - poses_at(receiver, sent_s)[:, :2]
            distance_m[rows] = np.hypot(difference_m[:, 0], difference_m[:, 1])
        elif recorded.any():
            distance_m[rows] = np.interp(sent_s, sent_s[recorded], packets.distance_m[rows][recorded])
    return distance_m
