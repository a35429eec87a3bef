"""The ticks of real robots' logs as observers of a run see them: motion, states, tallies and fates."""

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
    OwnPackets,
    link_packets,
    own_packets,
    usual_latency_s,
)
from swarmwire.metrics.real.real_log.real_logs import RealLogs, in_step
from swarmwire.metrics.real.real_log.robot_log import RealRobotLog
from swarmwire.metrics.real.real_log.time_base import TimeBase, poses_at, time_base

MARGIN_M = 1.0  # around where the robots were, of an arena that is unknown
AFTER_ALL_NS = 2**62


@dataclass(frozen=True)
class RealRun:
    """What observers of a run are given, of robots' logs.

    Attributes:
        static: one arena; names and bodies of the robots that have logs.
        base: the ticks.
        notes: what is amiss with the logs, a line each.
    """

    static: Static
    base: TimeBase
    notes: tuple[str, ...]
    _motion: "_Motion"
    _radio: "RadioTruth"

    def truths(self, ticks: int | None = None) -> Iterator[Truth]:
        """A truth for each of the first so many ticks, or of all.

        NaN: poses and velocities without a tracker, and contacts, which no log knows.
        """
        motion, robots = self._motion, self.static.robots
        everyone, here = np.ones(robots, np.bool_), np.ones(1, np.bool_)
        leds = np.zeros((robots, self.static.max_leds), np.int64)
        unknown = cast("IntArray", np.full((1, 2), np.nan))  # not 0: nobody counted
        for tick in range(self.base.ticks if ticks is None else ticks):
            yield Truth(
                tick=tick,
                time_ns=tick_start_ns(tick, self.base.rate_hz),
                running=here,
                alive=everyone,
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
        """What was under way as the last of the first so many ticks began."""
        return under_way(self._radio.tallies[:ticks])


@dataclass(frozen=True)
class _Motion:
    pose: FloatArray  # (ticks, robots, 3)
    velocity: FloatArray  # (ticks, robots, 3)
    command: FloatArray  # (ticks, robots, 3)
    state: IntArray  # (ticks, robots)
    states: tuple[str, ...]
    value: FloatArray | None  # (ticks, robots)


def real_run(logs: RealLogs, place: Static | None = None) -> RealRun:
    """The logs on their common time base; `place` describes the arena, if known.

    BadInput where the robots did not run at the same time.
    """
    logs = in_step(logs)
    base = time_base(logs)
    torus = place is not None and place.boundary == "torus"
    wrap = place.arena_size_m if place is not None and torus else (0.0, 0.0)
    pose = np.stack([poses_at(robot, base.time_s, wrap) for robot in logs.robots], axis=1)
    if not base.has_poses:
        pose[:] = np.nan
    motion = _Motion(
        pose, _velocity(pose, base, wrap), _commands(logs, base), *_states(logs, base), _values(logs, base)
    )
    static = _static(logs, base, pose, place)
    return RealRun(static, base, (*logs.notes, *base.notes), motion, radio_truth(logs, base))


def _velocity(pose: FloatArray, base: TimeBase, wrap: tuple[float, float]) -> FloatArray:
    """By differences from the tick before to the one after."""
    unwrapped = pose.copy()
    for place, period in enumerate((*wrap, 2.0 * np.pi)):
        if period:
            unwrapped[:, :, place] = np.unwrap(pose[:, :, place], axis=0, period=period)
    return np.gradient(unwrapped, 1.0 / base.rate_hz, axis=0)


def _latest(robot: RealRobotLog, base: TimeBase) -> IntArray:
    """The step that was the robot's last as each tick began, (ticks,)."""
    return np.maximum(np.searchsorted(robot.steps.time_s, base.time_s + 1e-6, "right") - 1, 0)


def _commands(logs: RealLogs, base: TimeBase) -> FloatArray:
    forward_and_turn = np.stack([of.steps.command[_latest(of, base)] for of in logs.robots], axis=1)
    return np.concatenate([forward_and_turn, np.zeros((*forward_and_turn.shape[:2], 1))], axis=2)


def _states(logs: RealLogs, base: TimeBase) -> tuple[IntArray, tuple[str, ...]]:
    states = {"": 0}
    columns: list[IntArray] = []
    for robot in logs.robots:
        named = np.array([states.setdefault(name, len(states)) for name in robot.steps.state], np.int64)
        columns.append(named[_latest(robot, base)])
    return np.stack(columns, axis=1), tuple(states)


def _values(logs: RealLogs, base: TimeBase) -> FloatArray | None:
    value = np.stack([robot.steps.value[_latest(robot, base)] for robot in logs.robots], axis=1)
    return None if np.isnan(value).all() else value


def _static(logs: RealLogs, base: TimeBase, pose: FloatArray, place: Static | None) -> Static:
    size_m, boundary = _around(pose) if place is None else (place.arena_size_m, place.boundary)
    return Static(
        name=logs.robots[0].about.swarm,
        seeds=(0,),
        rate_hz=base.rate_hz,
        arena_size_m=size_m,
        boundary=boundary,
        obstacles=((),) if place is None else place.obstacles[:1],
        groups=tuple(_groups(logs)),
        robot_names=logs.names,
        lights=() if place is None else place.lights[:1],
        floor=None if place is None else place.floor,
    )


def _around(pose: FloatArray) -> tuple[tuple[float, float], Boundary]:
    """An open arena around the origin that holds all places where a robot was."""
    far_m = np.nan_to_num(np.abs(pose[:, :, :2]).max(axis=(0, 1))) + MARGIN_M
    return (2.0 * float(far_m[0]), 2.0 * float(far_m[1])), "open"


def _groups(logs: RealLogs) -> Iterator[Group]:
    """Robots that stand next to one another and have one body."""
    start = 0
    for number, (body, own) in enumerate(groupby(logs.robots, lambda robot: robot.body)):
        count = len(list(own))
        yield Group(f"{body.name}-{number}", body, start, start + count)
        start += count


@dataclass(frozen=True)
class RadioTruth:
    """What the radio did by each tick. Packets count that were sent after the first tick began."""

    tallies: tuple[PacketCounts, ...]  # one per tick
    finished: tuple[ReceptionRecords, ...]  # one per tick


def radio_truth(logs: RealLogs, base: TimeBase) -> RadioTruth:
    """A loss is final when the packet is sent: logs do not say when it would have been received."""
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
    # A packet cannot arrive before it is sent, whatever the clocks.
    final_ns = np.maximum(_ns(np.where(received, links.received_s, base.start_s), base), sent_ns[: len(received)])
    # Packets that may still have been received after the last tick are not lost.
    late = ~received & (links.sent_s > base.end_s - usual_latency_s(links))
    final_ns[late] = AFTER_ALL_NS
    intended = [np.where(of.to[rows] == ALL, robots - 1, of.to[rows] >= 0) for _, of, rows in large]
    return ReceptionRecords(
        arena=np.zeros(len(to), np.int64),
        sender=with_large(links.sender, [np.full(len(rows), sender) for sender, _, rows in large]),
        receiver=with_large(links.receiver, [zeros + NO_ROBOT]),
        receivers=with_large(np.ones(len(received), np.int64), intended),
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
