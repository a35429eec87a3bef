"""A motion trace: the poses of robots over time, as a file has them, and the poses at a time of a run. Compiled.

Between two samples a robot moves in a straight line. Two samples of the same time are a jump: from that time on, the
later one is valid.
"""

# pyright: basic, reportUnknownMemberType=false

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from swarmwire.comms.base.angles import wrap_angle
from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.base.math.compiled import atan2

_wrap_angle = njit()(wrap_angle)
T, X, Y, Z, HEADING = 0, 1, 2, 3, 4  # columns of rows
PLANE = 3  # columns of rows in the plane


@dataclass(frozen=True, eq=False)
class MotionTrace:
    """The samples of all robots of a file, each robot's together.

    A sample's numbers are neighbours in memory: with an array of each, most accesses would miss the caches.
    """

    names: tuple[str, ...]  # names or numbers in the file: by number, or by first appearance
    first: IntArray  # (robots + 1,) samples of robot i are first[i]:first[i + 1], at least one
    rows: FloatArray  # (samples, 5) time in s, x, y and z in m, heading in rad; (samples, 3) without z and heading

    @property
    def t_s(self) -> FloatArray:
        """Times, (samples,), never less than that of the robot's sample before."""
        return self.rows[:, T]

    @property
    def x_m(self) -> FloatArray:
        """(samples,)."""
        return self.rows[:, X]

    @property
    def y_m(self) -> FloatArray:
        """(samples,)."""
        return self.rows[:, Y]

    @property
    def z_m(self) -> FloatArray:
        """Heights, (samples,); 0 if the file has none."""
        return self.rows[:, Z] if self.rows.shape[1] > PLANE else np.zeros(len(self.rows))

    @property
    def heading_rad(self) -> FloatArray:
        """Headings, (samples,); NaN where the file has none."""
        return self.rows[:, HEADING] if self.rows.shape[1] > PLANE else np.full(len(self.rows), np.nan)

    def shifted(self, dx_m: float, dy_m: float) -> "MotionTrace":
        """Return the trace with all positions moved by an offset."""
        if not dx_m and not dy_m:
            return self
        rows = self.rows.copy()
        rows[:, X] += dx_m
        rows[:, Y] += dy_m
        return replace(self, rows=rows)

    def samples(self) -> Iterator[FloatArray]:
        """Return the samples of each robot, (n, 4): time in s, x, y and z in m."""
        for start, stop in zip(self.first[:-1], self.first[1:], strict=True):
            part = slice(start, stop)
            yield np.column_stack((self.t_s[part], self.x_m[part], self.y_m[part], self.z_m[part]))

    def numbers(self, start: int) -> Sequence[int]:
        """Return the names as rising numbers from at least `start`; of other names, numbers from `start` on."""
        numbers = [int(name) for name in self.names if name.isdecimal()]
        if len(numbers) == len(self.names) and numbers == sorted(set(numbers)) and numbers[0] >= start:
            return numbers
        return range(start, start + len(self.names))


def trace_from(names: Sequence[str], samples: Sequence[Any]) -> MotionTrace:
    """Return the trace of robots without headings; samples of each: rows of time in s, x, y and z in m."""
    first = np.zeros(len(names) + 1, np.int64)
    first[1:] = np.cumsum([len(rows) for rows in samples])
    t_s, x_m, y_m, z_m = np.concatenate(samples, dtype=np.float64).T
    return trace_of_columns(names, first, t_s, x_m, y_m, z_m, np.full(len(t_s), np.nan))


def trace_of_columns(names: Sequence[str], first: IntArray, *columns: FloatArray) -> MotionTrace:
    """Return the trace of columns (samples,): time in s, x, y and z in m, heading in rad."""
    _, _, _, z_m, heading_rad = columns
    in_space = z_m.any() or not np.isnan(heading_rad).all()
    return MotionTrace(tuple(names), first, np.stack(columns if in_space else columns[:PLANE], axis=1))


class TracePoses:
    """Poses of robots of a trace over the time of a run.

    Headings turn the short way between two samples that both have one. Elsewhere a robot heads where it moves; while it
    stands, where it moved before; before any motion, along x. A position or heading depends on the time alone, bit for
    bit, not on the times that were asked for before.
    """

    def __init__(self, trace: MotionTrace, order: Sequence[int], start_s: float) -> None:
        """`order`: index in the trace of each robot of the run; the run starts at `start_s` of the file."""
        self._start_s = start_s
        self._first, self._rows = trace.first, trace.rows
        if list(order) != list(range(len(trace.names))):
            robots = [trace.rows[trace.first[robot] : trace.first[robot + 1]] for robot in order]
            self._first = np.cumsum([0, *map(len, robots)], dtype=np.int64)
            self._rows = np.concatenate(robots)
        self._cursor = self._first[:-1] - 1  # each robot's last sample up to now; at the start, before its first one
        self._direction_rad = np.zeros(len(order))  # of each robot's last motion up to now

    def at(self, time_s: float) -> FloatArray:
        """Return the poses (k, 4) at a time of the run: x, y, z in m, heading in rad.

        Before its first sample and after its last one a robot stands there. A time before that of the last call is
        searched for from the start of the file.
        """
        poses = np.zeros((len(self._cursor), 4))
        _interpolate(self._start_s + time_s, self._rows, self._first, self._cursor, self._direction_rad, poses)
        return poses


@njit()
def _interpolate(time_s, rows, first, cursor, direction_rad, poses):
    """Write the poses at a time of the file; cursors and directions move on with it."""
    axes = min(rows.shape[1] - X, 3)
    for robot in range(len(cursor)):
        start, stop = first[robot], first[robot + 1]
        i, motion = cursor[robot], -1  # the last segment with a motion among those that begin since the last call
        if i >= start and time_s < rows[i, T]:  # time went back
            i, direction_rad[robot] = start - 1, 0.0
        while i + 1 < stop and rows[i + 1, T] <= time_s:
            i += 1
            if i + 1 < stop and _moves(rows, i):
                motion = i
        if motion >= 0:
            dx, dy = rows[motion + 1, X] - rows[motion, X], rows[motion + 1, Y] - rows[motion, Y]
            direction_rad[robot] = atan2(dy, dx)
        cursor[robot], heading = i, np.nan
        if start <= i < stop - 1:
            share = (time_s - rows[i, T]) / (rows[i + 1, T] - rows[i, T])
            for axis in range(axes):
                position = rows[i, X + axis]
                poses[robot, axis] = position + share * (rows[i + 1, X + axis] - position)
            if axes == 3:
                heading = rows[i, HEADING]
                heading = _wrapped(heading + share * _wrapped(rows[i + 1, HEADING] - heading))
        else:
            i = max(i, start)
            for axis in range(axes):
                poses[robot, axis] = rows[i, X + axis]
            if axes == 3:
                heading = _wrapped(rows[i, HEADING])
        poses[robot, 3] = direction_rad[robot] if np.isnan(heading) else heading


@njit()
def _moves(rows, i):
    """Return True if the segment from sample i on is a motion in the plane that takes time."""
    takes_time = rows[i, T] < rows[i + 1, T]
    return takes_time and (rows[i, X] != rows[i + 1, X] or rows[i, Y] != rows[i + 1, Y])


@njit()
def _wrapped(angle_rad):
    return angle_rad if np.isnan(angle_rad) else _wrap_angle(angle_rad)
