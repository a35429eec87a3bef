"""The time that all robots' logs have in common, and the robots' poses at any time in it."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, FloatArray
from swarmwire.comms.base.clock import NS_PER_S, tick_start_ns
from swarmwire.comms.base.errors import BadInput
from swarmwire.metrics.real.real_log.real_logs import RealLogs, named
from swarmwire.metrics.real.real_log.robot_log import TICKS, RealRobotLog

MAX_TICKS = 5_000_000  # which still fit the memory: days of steps
CUT_S = 1.0  # of a robot's log, from which on what is left out is worth a word
GAP_S = 1.0  # without a pose, from which on it is worth a word
Span = tuple[float, float]  # times in s, from the first to the last
Wrap = tuple[float, float]  # a torus's width and height in m; 0: none


@dataclass(frozen=True)
class TimeBase:
    """Ticks of the swarm's rate, the first at `start_s`."""

    start_s: float  # UTC since 1970
    rate_hz: int
    ticks: int
    has_poses: bool  # of all robots
    notes: tuple[str, ...]

    @property
    def end_s(self) -> float:
        """When the last tick begins."""
        return self.start_s + (self.ticks - 1) / self.rate_hz

    @property
    def time_s(self) -> FloatArray:
        """When each tick begins, (ticks,), UTC since 1970."""
        starts_ns = [tick_start_ns(tick, self.rate_hz) for tick in range(self.ticks)]
        return self.start_s + np.array(starts_ns) / NS_PER_S


def time_base(logs: RealLogs) -> TimeBase:
    """The ticks in common; BadInput where there is none, as the robots did not run at the same time, or too many."""
    for robot in logs.robots:
        if not len(robot.steps.time_s):
            raise BadInput(f"{robot.where}/{TICKS}", "", "expected at least one step")
    whole = [(float(of.steps.time_s[0]), float(of.steps.time_s[-1])) for of in logs.robots]
    posed = [posed_span_s(robot) for robot in logs.robots]
    has_poses = all(span is not None for span in posed)
    spans = [span for span in posed if span is not None] if has_poses else whole
    start_s, end_s = max(start for start, _ in spans), min(end for _, end in spans)
    rate_hz = max(round(logs.rate_hz), 1)
    ticks = int(np.floor((end_s - start_s) * rate_hz + 1e-6)) + 1
    if ticks < 2:
        late, early = _names_at_ends(logs, spans)
        raise BadInput(logs.where, "", f"expected robots that ran at the same time: {late} began as {early} had ended")
    if ticks > MAX_TICKS:
        expected = f"expected {MAX_TICKS} steps in common at most, got {ticks}: was a clock set meanwhile?"
        raise BadInput(logs.where, "t_s", expected)
    notes = [*_cut(logs, spans, start_s, end_s), *_pose_notes(logs, (start_s, end_s), has_poses=has_poses)]
    return TimeBase(start_s, rate_hz, ticks, has_poses, tuple(notes))


def _names_at_ends(logs: RealLogs, spans: list[tuple[float, float]]) -> tuple[str, str]:
    starts, ends = [start for start, _ in spans], [end for _, end in spans]
    return logs.names[int(np.argmax(starts))], logs.names[int(np.argmin(ends))]


def _cut(logs: RealLogs, spans: list[tuple[float, float]], start_s: float, end_s: float) -> list[str]:
    """What the latest start and the earliest end leave out of the others' logs."""
    late, early = _names_at_ends(logs, spans)
    before_s, after_s = start_s - min(start for start, _ in spans), max(end for _, end in spans) - end_s
    notes: list[str] = []
    if before_s > CUT_S:
        notes.append(f"the first {before_s:.1f} s of other robots are left out: {late} began so late")
    if after_s > CUT_S:
        notes.append(f"the last {after_s:.1f} s of other robots are left out: {early} ended so early")
    return notes


def _pose_notes(logs: RealLogs, span: tuple[float, float], *, has_poses: bool) -> list[str]:
    if not has_poses:
        without = [robot.name for robot in logs.robots if posed_span_s(robot) is None]
        some = "" if len(without) == len(logs.robots) else f" of {named(without)}"
        return [f"no poses{some}: without a tracker, measures of positions are not in the log"]
    gaps = {robot.name: longest_gap_s(robot, span) for robot in logs.robots}
    wide = [f"{name} {gap_s:.1f} s" for name, gap_s in gaps.items() if gap_s > GAP_S]
    return [f"poses are missing for a while ({named(wide)}) and drawn straight through"] if wide else []


def posed_span_s(robot: RealRobotLog) -> Span | None:
    """From the first to the last step at which the tracker knew the robot; None if it never did, or once alone."""
    known_s = robot.steps.time_s[_known(robot)]
    return (float(known_s[0]), float(known_s[-1])) if len(known_s) > 1 else None


def longest_gap_s(robot: RealRobotLog, span: Span) -> float:
    """The longest time without a pose within a span."""
    known_s = robot.steps.time_s[_known(robot)]
    within = known_s[(known_s > span[0]) & (known_s < span[1])]
    return float(np.diff(within, prepend=span[0], append=span[1]).max())


def poses_at(robot: RealRobotLog, time_s: FloatArray, wrap: Wrap = (0.0, 0.0)) -> FloatArray:
    """Poses (n, 3) at these times (n,): in a straight line between those known, turning the shorter way; NaN if none.

    Before the first and after the last the robot stands where it was seen.
    """
    known = _known(robot)
    if not known.any():
        return np.full((len(time_s), 3), np.nan)
    at_s, pose = robot.steps.time_s[known], robot.steps.pose[known]
    columns = [
        _between(time_s, at_s, pose[:, place], period)
        for place, period in enumerate((*wrap, 2.0 * np.pi))  # a robot crosses a torus's seam, no floor between
    ]
    return np.stack(columns, axis=1)


def _between(time_s: FloatArray, at_s: FloatArray, value: FloatArray, period: float) -> FloatArray:
    if period == 0.0:
        return np.interp(time_s, at_s, value)
    unwrapped = np.interp(time_s, at_s, np.unwrap(value, period=period))
    return unwrapped - period * np.round(unwrapped / period)


def _known(robot: RealRobotLog) -> AnyArray:
    return np.isfinite(robot.steps.pose[:, 0])
