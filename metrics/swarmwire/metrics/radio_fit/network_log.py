"""Logs of a real network, which tells no strengths: what became of every packet on every link, with its distance."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray
from swarmwire.metrics.radio_fit.loss_sequences import LossSequences
from swarmwire.metrics.real_log.clock_offsets import in_step
from swarmwire.metrics.real_log.link_packets import LinkPackets, Node, link_packets, own_packets, usual_latency_s
from swarmwire.metrics.real_log.log_table import LogTable
from swarmwire.metrics.real_log.poses import posed_span_s, poses_at
from swarmwire.metrics.real_log.real_logs import RealLogs
from swarmwire.metrics.real_log.robot_log import RobotLog, received_packets

NEEDED = ("t_s", "tx", "rx", "seq")


@dataclass(frozen=True)
class NetworkLog:
    """Packets of all links, link after link, by number within each."""

    names: tuple[str, ...]
    packets: LinkPackets
    distance_m: FloatArray  # (n,) as each was sent; NaN: not known
    notes: tuple[str, ...]

    @property
    def lost(self) -> BoolArray:
        """Which packets were lost, (n,)."""
        return np.isnan(self.packets.received_s)

    @property
    def has_distances(self) -> bool:
        """Whether any packet's distance is known: the robots had a tracker."""
        return bool(np.isfinite(self.distance_m).any())

    def within(self, distance_m: float) -> "NetworkLog":
        """The packets that were sent at most so far."""
        near = self.distance_m <= distance_m
        return replace(self, packets=self.packets.rows(near), distance_m=self.distance_m[near])

    def sequences(self, kept: BoolArray) -> LossSequences:
        """The losses of some of the packets (n,), in the order of time within each link."""
        of = self.packets.rows(kept)
        link = of.sender * len(self.names) + of.receiver
        order = np.lexsort((of.sent_s, link))
        link, sent_s, lost = link[order], of.sent_s[order], self.lost[kept][order]
        opens = np.diff(link, prepend=-1) != 0
        since_s = np.where(opens, np.inf, np.maximum(np.diff(sent_s, prepend=0.0), 1e-9))
        return LossSequences(np.cumsum(opens) - 1, since_s, lost)


def is_network_table(path: Path) -> bool:
    """Whether a file is a CSV of what was received that tells no strengths; files that cannot be read are none."""
    if path.suffix.lower() != ".csv":
        return False
    try:
        with path.open(encoding="utf-8") as file:
            columns = file.readline().strip().split(",")
    except (OSError, ValueError):
        return False
    return set(NEEDED) <= set(columns) and "rssi_dbm" not in columns


def network_log_of_table(path: Path) -> NetworkLog:
    """A table of what robots received; packets before a link's first and after its last leave no trace.

    Columns: t_s, tx, rx, seq; if they are there to, latency_s, distance_m. BadInput for what cannot be.
    """
    table = LogTable(path, NEEDED)
    notes = ("half a line at the end was dropped",) if table.half_line else ()
    received, receivers = received_packets(table), np.array(table.texts("rx"), np.str_)
    table.refuse_where(received.sender == receivers, "rx", "expected another robot than tx")
    names = sorted({*received.sender.tolist(), *receivers.tolist()})
    nodes = [Node(name, None, received.picked(np.flatnonzero(receivers == name)), None) for name in names]
    return _network_log(nodes, [None] * len(nodes), str(path), notes)


def network_log_of_robots(logs: RealLogs) -> NetworkLog:
    """All robots' received.csv and sent.csv, by one clock; also links from robots whose own log is not there."""
    logs = in_step(logs)
    by_name: dict[str, RobotLog] = dict(zip(logs.names, logs.robots, strict=True))
    robots = [by_name.get(name) for name in logs.robots[0].about.robots]
    nodes = [
        Node(name, None, None, None) if robot is None else Node(name, robot.sent, robot.received, _span_s(robot))
        for name, robot in zip(logs.robots[0].about.robots, robots, strict=True)
    ]
    return _network_log(nodes, robots, logs.where, logs.notes)


def _span_s(robot: RobotLog) -> tuple[float, float] | None:
    steps_s = robot.steps.time_s
    return (float(steps_s[0]), float(steps_s[-1])) if len(steps_s) else None


def _network_log(
    nodes: Sequence[Node], robots: Sequence[RobotLog | None], where: str, notes: tuple[str, ...]
) -> NetworkLog:
    packets = link_packets(nodes, own_packets(nodes, where))
    ends_s = np.array([node.span_s[1] if node.span_s else np.inf for node in nodes])
    # What may still have been received after a log's end is not lost.
    final = np.isfinite(packets.received_s) | (packets.sent_s <= ends_s[packets.receiver] - usual_latency_s(packets))
    packets = packets.rows(final)
    return NetworkLog(tuple(node.name for node in nodes), packets, _distances_m(packets, robots), notes)


def _distances_m(packets: LinkPackets, robots: Sequence[RobotLog | None]) -> FloatArray:
    """By the poses of both as the packet was sent, else between those that receivers noted on the link; (n,)."""
    distance_m = np.full(len(packets.sender), np.nan)
    link = packets.sender * max(len(robots), 1) + packets.receiver
    for number in np.unique(link):
        rows = np.flatnonzero(link == number)
        sender, receiver = robots[int(packets.sender[rows[0]])], robots[int(packets.receiver[rows[0]])]
        sent_s = packets.sent_s[rows]
        noted = np.isfinite(packets.distance_m[rows])
        if sender and receiver and posed_span_s(sender) and posed_span_s(receiver):
            apart = poses_at(sender, sent_s)[:, :2] - poses_at(receiver, sent_s)[:, :2]
            distance_m[rows] = np.hypot(apart[:, 0], apart[:, 1])
        elif noted.any():
            distance_m[rows] = np.interp(sent_s, sent_s[noted], packets.distance_m[rows][noted])
    return distance_m
