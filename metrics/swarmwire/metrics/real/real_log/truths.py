"""Real robots' logs in the form of a run's observers, tick by tick: motion, states, tallies and fates."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from itertools import groupby
from typing import Any, cast

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.base.clock import NS_PER_S, tick_start_ns
from swarmwire.comms.base.geometry.shapes import Boundary
from swarmwire.comms.base.sentinels import NO_ROBOT
from swarmwire.comms.observe.truth import Group, Static, Truth
from swarmwire.comms.radio.records import PacketCounts, ReceptionRecords
from swarmwire.comms.robot.packets import FATE_NAMES, Fate
from swarmwire.metrics.real.real_log.link_packets import (
    ALL,
    LinkPackets,
    Node,
    SenderPackets,
    link_packets,
    sender_packets,
    usual_latency_s,
)
from swarmwire.metrics.real.real_log.real_logs import RealLogs, in_step
from swarmwire.metrics.real.real_log.robot_log import RealRobotLog
from swarmwire.metrics.real.real_log.time_base import TimeBase, poses_at, time_base

MARGIN_M = 1.0  # margin around all positions, for an unknown arena
AFTER_ALL_NS = 2**62


@dataclass(frozen=True)
class RealRun:
    """Robots' logs in the form of a run's observers.

    Attributes:
        static: an arena, with names and bodies of the robots with logs.
        base: the ticks.
        notes: problems of the logs, a line each.
    """

    static: Static
    base: TimeBase
    notes: tuple[str, ...]
    _motion: "_Motion"
    _radio: "RadioTruth"

    def truths(self, ticks: int | None = None) -> Iterator[Truth]:
        """Yield the truth of each of the first ticks, or of all.

        Poses and velocities without a tracker are NaN, and so are contacts, which no log contains.
        """
        motion, robots = self._motion, self.static.robots
        alive, running = np.ones(robots, np.bool_), np.ones(1, np.bool_)
        leds = np.zeros((robots, self.static.max_leds), np.int64)
        unknown = cast("IntArray", np.full((1, 2), np.nan))  # 0 would mean no contacts
        for tick in range(self.base.ticks if ticks is None else ticks):
            yield Truth(
                tick=tick,
                time_ns=tick_start_ns(tick, self.base.rate_hz),
                running=running,
                alive=alive,
                pose=motion.pose[tick],
                velocity=motion.velocity[tick],
                command=motion.command[tick],
                state=motion.state[tick],
                states=motion.states,
                leds=leds,
                readings={},
                contact_onsets=unknown,
                edges=None,
                tally=self._radio.tallies[tick],
                finished=self._radio.finished[tick],
                value=None if motion.value is None else motion.value[tick],
            )

    def under_way(self, ticks: int) -> PacketCounts:
        """Return the packets under way at the start of the last of the first ticks."""
        return under_way(self._radio.tallies[:ticks])


@dataclass(frozen=True)
class _Motion:
    pose: FloatArray  # (ticks, robots, 3)
    velocity: FloatArray  # (ticks, robots, 3)
    command: FloatArray  # (ticks, robots, 3)
    state: IntArray  # (ticks, robots)
    states: tuple[str, ...]
    value: FloatArray | None  # (ticks, robots)


def real_run(logs: RealLogs, scenery: Static | None = None) -> RealRun:
    """Return the logs on their common time base; `scenery` describes the arena, if known.

    BadInput if the robots did not run at the same time.
    """
    logs = in_step(logs)
    base = time_base(logs)
    torus = scenery is not None and scenery.boundary == "torus"
    wrap = scenery.arena_size_m if scenery is not None and torus else (0.0, 0.0)
    pose = np.stack([poses_at(robot, base.time_s, wrap) for robot in logs.robots], axis=1)
    if not base.has_poses:
        pose[:] = np.nan
    motion = _Motion(
        pose, _velocity(pose, base, wrap), _commands(logs, base), *_states(logs, base), _values(logs, base)
    )
    static = _static(logs, base, pose, scenery)
    return RealRun(static, base, (*logs.notes, *base.notes), motion, radio_truth(logs, base))


def _velocity(pose: FloatArray, base: TimeBase, wrap: tuple[float, float]) -> FloatArray:
    """Return velocities by central differences."""
    unwrapped = pose.copy()
    for column, period in enumerate((*wrap, 2.0 * np.pi)):
        if period:
            unwrapped[:, :, column] = np.unwrap(pose[:, :, column], axis=0, period=period)
    return np.gradient(unwrapped, 1.0 / base.rate_hz, axis=0)


def _latest(robot: RealRobotLog, base: TimeBase) -> IntArray:
    """Return the index of the robot's latest step at the start of each tick, (ticks,)."""
    return np.maximum(np.searchsorted(robot.steps.time_s, base.time_s + 1e-6, "right") - 1, 0)


def _commands(logs: RealLogs, base: TimeBase) -> FloatArray:
    command = np.stack([robot.steps.command[_latest(robot, base)] for robot in logs.robots], axis=1)
    return np.concatenate([command, np.zeros((*command.shape[:2], 1))], axis=2)


def _states(logs: RealLogs, base: TimeBase) -> tuple[IntArray, tuple[str, ...]]:
    states = {"": 0}
    columns: list[IntArray] = []
    for robot in logs.robots:
        codes = np.array([states.setdefault(name, len(states)) for name in robot.steps.state], np.int64)
        columns.append(codes[_latest(robot, base)])
    return np.stack(columns, axis=1), tuple(states)


def _values(logs: RealLogs, base: TimeBase) -> FloatArray | None:
    value = np.stack([robot.steps.value[_latest(robot, base)] for robot in logs.robots], axis=1)
    return None if np.isnan(value).all() else value


def _static(logs: RealLogs, base: TimeBase, pose: FloatArray, scenery: Static | None) -> Static:
    size_m, boundary = _bounds(pose) if scenery is None else (scenery.arena_size_m, scenery.boundary)
    return Static(
        name=logs.robots[0].about.swarm,
        seeds=(0,),
        rate_hz=base.rate_hz,
        arena_size_m=size_m,
        boundary=boundary,
        obstacles=((),) if scenery is None else scenery.obstacles[:1],
        groups=tuple(_groups(logs)),
        robot_names=logs.names,
        lights=() if scenery is None else scenery.lights[:1],
        floor=None if scenery is None else scenery.floor,
    )


def _bounds(pose: FloatArray) -> tuple[tuple[float, float], Boundary]:
    """Return size and boundary of an open arena around the origin that contains all positions."""
    far_m = np.nan_to_num(np.abs(pose[:, :, :2]).max(axis=(0, 1))) + MARGIN_M
    return (2.0 * float(far_m[0]), 2.0 * float(far_m[1])), "open"


def _groups(logs: RealLogs) -> Iterator[Group]:
    """Yield a group per run of consecutive robots with the same body."""
    start = 0
    for number, (body, robots) in enumerate(groupby(logs.robots, lambda robot: robot.body)):
        assert body is not None, "only fits of a radio do without bodies"
        count = len(list(robots))
        yield Group(f"{body.name}-{number}", body, start, start + count)
        start += count


@dataclass(frozen=True)
class RadioTruth:
    """The radio's counts and final fates of each tick, for packets sent after the start of the first tick."""

    tallies: tuple[PacketCounts, ...]  # one per tick
    finished: tuple[ReceptionRecords, ...]  # one per tick


def radio_truth(logs: RealLogs, base: TimeBase) -> RadioTruth:
    """Return counts and fates; a loss is final at sending, since logs contain no time of a missing reception."""
    nodes = [Node(robot.name, robot.sent, robot.received, (base.start_s, base.end_s)) for robot in logs.robots]
    senders = sender_packets(nodes, logs.where)
    rows = _rows(link_packets(nodes, senders), senders, len(nodes), base)
    edges_ns = (base.time_s - base.start_s) * NS_PER_S
    sent_tick = np.searchsorted(edges_ns, rows.sent_at_ns)
    final_tick = np.searchsorted(edges_ns, rows.final_at_ns)
    order = np.lexsort((rows.final_at_ns, final_tick))
    ends = np.searchsorted(final_tick[order], np.arange(base.ticks + 1))
    tallies = _tallies(rows, _sent_ticks(senders, base), sent_tick, final_tick, base.ticks)
    finished = tuple(_selected(rows, order[ends[tick] : ends[tick + 1]]) for tick in range(base.ticks))
    return RadioTruth(tallies, finished)


def under_way(tallies: Sequence[PacketCounts]) -> PacketCounts:
    """Return the packets that were sent in these first ticks and have no fate in them."""
    fates = np.zeros((1, len(FATE_NAMES)), np.int64)
    fates[0, Fate.IN_FLIGHT] = sum(int(tally.intended.sum() - tally.fates.sum()) for tally in tallies)
    none = np.zeros(1, np.int64)
    return PacketCounts(none, none, none, fates)


def _rows(links: LinkPackets, senders: tuple[SenderPackets, ...], robots: int, base: TimeBase) -> ReceptionRecords:
    """Return a row per receiver of each packet within the ticks; packets that are too large have a single row."""
    received = np.isfinite(links.received_s)
    large = [
        (sender, packets, np.flatnonzero(packets.too_large & _within(packets.sent_s, base)))
        for sender, packets in enumerate(senders)
    ]
    zeros = np.zeros(sum(len(rows) for _, _, rows in large), np.int64)

    def with_large(column: IntArray, large_column: list[IntArray]) -> IntArray:
        return np.concatenate([column.astype(np.int64), *large_column])

    to = with_large(links.to, [packets.to[rows] for _, packets, rows in large])
    sent_ns = with_large(_ns(links.sent_s, base), [_ns(packets.sent_s[rows], base) for _, packets, rows in large])
    # Clocks may differ, but a packet cannot arrive before it is sent.
    final_ns = np.maximum(_ns(np.where(received, links.received_s, base.start_s), base), sent_ns[: len(received)])
    # Packets that may still have been received after the last tick are not lost.
    late = ~received & (links.sent_s > base.end_s - usual_latency_s(links))
    final_ns[late] = AFTER_ALL_NS
    intended = [np.where(packets.to[rows] == ALL, robots - 1, packets.to[rows] >= 0) for _, packets, rows in large]
    return ReceptionRecords(
        arena=np.zeros(len(to), np.int64),
        sender=with_large(links.sender, [np.full(len(rows), sender) for sender, _, rows in large]),
        receiver=with_large(links.receiver, [zeros + NO_ROBOT]),
        receivers=with_large(np.ones(len(received), np.int64), intended),
        to=to,
        sequence=with_large(links.sequence, [packets.sequence[rows] for _, packets, rows in large]),
        sent_at_ns=sent_ns,
        on_air_at_ns=sent_ns,
        final_at_ns=with_large(final_ns, [sent_ns[len(received) :]]),
        fate=with_large(np.where(received, Fate.RECEIVED, Fate.LOST), [zeros + Fate.TOO_LARGE]),
        size_bytes=with_large(links.size_bytes, [packets.size_bytes[rows] for _, packets, rows in large]),
        tag=with_large(links.tag, [packets.tag[rows] for _, packets, rows in large]),
    )


def _tallies(
    rows: ReceptionRecords, sent: IntArray, sent_tick: IntArray, final_tick: IntArray, ticks: int
) -> tuple[PacketCounts, ...]:
    intended = np.bincount(sent_tick, rows.receivers, minlength=ticks + 1).astype(np.int64)
    fates = np.zeros((ticks + 1, len(FATE_NAMES)), np.int64)
    np.add.at(fates, (np.minimum(final_tick, ticks), rows.fate), rows.receivers)
    # A real network has no nominal range: all intended receivers of a packet on air count as in range.
    in_range = fates[:, Fate.RECEIVED] + fates[:, Fate.LOST]
    return tuple(
        PacketCounts(sent[t : t + 1], intended[t : t + 1], in_range[t : t + 1], fates[t : t + 1]) for t in range(ticks)
    )


def _sent_ticks(senders: tuple[SenderPackets, ...], base: TimeBase) -> IntArray:
    """Return the number of packets sent before each tick, since the previous one, (ticks,)."""
    sent_s = np.concatenate([packets.sent_s[_within(packets.sent_s, base)] for packets in senders])
    tick = np.searchsorted((base.time_s - base.start_s) * NS_PER_S, _ns(sent_s, base))
    return np.bincount(tick, minlength=base.ticks)[: base.ticks]


def _selected(rows: ReceptionRecords, index: IntArray) -> ReceptionRecords:
    columns: dict[str, Any] = {field.name: getattr(rows, field.name) for field in fields(rows)}
    selected: dict[str, Any] = {name: None if column is None else column[index] for name, column in columns.items()}
    return ReceptionRecords(**selected)


def _within(time_s: FloatArray, base: TimeBase) -> BoolArray:
    return (time_s >= base.start_s) & (time_s <= base.end_s)


def _ns(time_s: FloatArray, base: TimeBase) -> IntArray:
    """Return times in ns since the start of the first tick."""
    return np.round((time_s - base.start_s) * NS_PER_S).astype(np.int64)
