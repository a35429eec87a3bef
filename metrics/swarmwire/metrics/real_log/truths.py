"""Logs of real robots as a run: what does not change, and the truth of each tick, as observers of a run see it."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby
from typing import cast

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.clock import tick_start_ns
from swarmwire.comms.truth import Boundary, Group, PacketCounts, Static, Truth
from swarmwire.metrics.real_log.clock_offsets import in_step
from swarmwire.metrics.real_log.poses import poses_at
from swarmwire.metrics.real_log.radio_truth import RadioTruth, radio_truth, under_way
from swarmwire.metrics.real_log.real_logs import RealLogs
from swarmwire.metrics.real_log.robot_log import RobotLog
from swarmwire.metrics.real_log.time_base import TimeBase, time_base

MARGIN_M = 1.0  # around where the robots were, of an arena that nobody tells


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
    _radio: RadioTruth

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
    """The logs on their common time base; `place` tells the arena that the robots were in, if anything does.

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


def _latest(robot: RobotLog, base: TimeBase) -> IntArray:
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
    for number, (body, own) in enumerate(groupby(logs.robots, lambda robot: robot.about.body)):
        count = len(list(own))
        yield Group(f"{body.name}-{number}", body, start, start + count)
        start += count
