"""Robots that a source moves: where they are at the end of each tick. Compiled."""

# pyright: basic, reportUnknownMemberType=false

from collections.abc import Mapping, Sequence

import numpy as np

from swarmwire.comms.base.angles import wrap_angle
from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.observe.truth import Group
from swarmwire.comms.robot.tick_io import SparseTable
from swarmwire.world.motion.source import LockstepSource

_wrap_angle = njit()(wrap_angle)


class FollowedRobots:
    """The robots of all groups that a source moves; they move alike in all arenas.

    A robot moves on a straight line, with constant speed, from its pose at a tick's start to that at its end. A robot
    of a live source stands where it was placed until its first pose, which sets it there without a speed, mostly before
    the first tick (`first_states`); it keeps each pose until the next one arrives.

    Attributes:
        index: (k,) the robot indices that a source moves, rising.
    """

    def __init__(self, groups: Sequence[Group], sources: Mapping[str, LockstepSource], rate_hz: int) -> None:
        """`sources` has the source in lockstep of each group; followed groups without one have a live source."""
        self._rate_hz, self._ticks = rate_hz, 0
        self._groups = [group for group in groups if group.followed]
        self._sources = sources
        self._is_followed: BoolArray = np.zeros(groups[-1].stop, np.bool_)
        for group in self._groups:
            self._is_followed[group.start : group.stop] = True
        self.index: IntArray = np.flatnonzero(self._is_followed)
        self._column = np.cumsum(self._is_followed) - 1  # robot index -> column in the arrays (k,)
        self._pose = np.zeros((len(self.index), 4))  # x, y, z in m, heading in rad
        for group in self._groups:
            self._pose[self._columns(group), 2] = group.body.altitude_m
        self._has_pose = np.zeros(len(self.index), np.bool_)  # False: its live source has given no pose yet
        self._is_live = self._is_followed.copy()
        for group in self._groups:
            if group.name in sources:
                self._is_live[group.start : group.stop] = False
        self._read(0.0)

    @property
    def altitude_m(self) -> FloatArray:
        """Height of the lower side of each robot above the floor, (k,)."""
        return self._pose[:, 2]

    def first_states(self, state: FloatArray, poses: SparseTable) -> FloatArray:
        """Return the states before the first tick, (arenas, k, 6), with the first `poses`; see `end_states`."""
        at_rest = np.zeros_like(self._has_pose)
        self._apply(state, poses)
        return _end_states(state, self.index, self._pose, at_rest, self._has_pose, float(self._rate_hz))

    def end_states(self, state: FloatArray, poses: SparseTable) -> FloatArray:
        """Return the states at the end of the next tick, (arenas, k, 6), and count the tick.

        Args:
            state: (arenas, robots, 6) the present state of all robots.
            poses: new poses of robots with a live source, in slots x, y, z, heading; only with a single arena.
        """
        self._ticks += 1
        had_pose = self._has_pose.copy()
        if len(poses):
            self._apply(state, poses)
        self._read(self._ticks / self._rate_hz)
        return _end_states(state, self.index, self._pose, had_pose, self._has_pose, float(self._rate_hz))

    def start_poses(self) -> dict[str, FloatArray]:
        """Return x, y in m and heading in rad at the start, (count, 3), of each group with a source in lockstep."""
        groups = (group for group in self._groups if group.name in self._sources)
        return {group.name: self._pose[self._columns(group)][:, (0, 1, 3)] for group in groups}

    def _columns(self, group: Group) -> slice:
        return slice(int(self._column[group.start]), int(self._column[group.stop - 1]) + 1)

    def _apply(self, state: FloatArray, poses: SparseTable) -> None:
        """Keep new poses of robots with a live source; a first pose without a heading keeps that of the place."""
        is_first = ~self._has_pose
        self._pose[is_first, 3] = state[0, self.index[is_first], 2]
        poses = poses.select(np.flatnonzero(self._is_live[poses.rows]))
        column = self._column[poses.rows]
        self._pose[column, poses.slot] = poses.value
        self._has_pose[column] = True

    def _read(self, time_s: float) -> None:
        for group in self._groups:
            if group.name in self._sources:
                columns = self._columns(group)
                self._pose[columns], self._has_pose[columns] = self._sources[group.name].at(time_s), True


@njit()
def _end_states(state, index, pose, had_pose, has_pose, rate_hz):
    """Return the states at the end of a tick, (arenas, k, 6), of the robots `index` (k,) that move to `pose` (k, 4)."""
    end = np.zeros((len(state), len(index), 6))
    for arena in range(len(state)):
        for k in range(len(index)):
            now, then = state[arena, index[k]], end[arena, k]
            then[0], then[1], then[2] = now[0], now[1], now[2]
            if not has_pose[k]:
                continue
            then[0], then[1], then[2] = pose[k, 0], pose[k, 1], now[2] + _wrap_angle(pose[k, 3] - now[2])
            if had_pose[k]:
                for column in range(3):
                    then[3 + column] = (then[column] - now[column]) * rate_hz
    return end
