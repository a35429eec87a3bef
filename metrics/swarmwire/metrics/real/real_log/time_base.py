"""The common time of all robots' logs, and the robots' poses at any time in it."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, FloatArray
from swarmwire.comms.base.clock import NS_PER_S, tick_start_ns
from swarmwire.comms.base.errors import BadInput
from swarmwire.metrics.real.real_log.real_logs import RealLogs, named
from swarmwire.metrics.real.real_log.robot_log import TICKS, RealRobotLog

MAX_TICKS = 5_000_000  # days of steps, which still fit the memory
MIN_CUT_S = 1.0  # longer omitted parts of a log are noted
MIN_GAP_S = 1.0  # longer gaps between poses are noted
Span = tuple[float, float]  # first and last time in s
Wrap = tuple[float, float]  # width and height of a torus in m; 0: no torus


@dataclass(frozen=True)
class TimeBase:
    """Ticks of the swarm's rate, the first at `start_s`."""

    start_s: float  # UTC since 1970
    rate_hz: int
    ticks: int
    has_poses: bool  # every robot has poses
    notes: tuple[str, ...]

    @property
    def end_s(self) -> float:
        """Start of the last tick."""
        return self.start_s + (self.ticks - 1) / self.rate_hz

    @property
    def time_s(self) -> FloatArray:
        """Starts of the ticks, (ticks,), UTC since 1970."""
        starts_ns = [tick_start_ns(tick, self.rate_hz) for tick in range(self.ticks)]
        return self.start_s + np.array(starts_ns) / NS_PER_S


def time_base(logs: RealLogs) -> TimeBase:
    """Return the common ticks; BadInput if the robots did not run at the same time, or for too many ticks."""
    for robot in logs.robots:
        if not len(robot.steps.time_s):
            raise BadInput(f"{robot.where}/{TICKS}", "", "expected at least one step")
    logged = [(float(robot.steps.time_s[0]), float(robot.steps.time_s[-1])) for robot in logs.robots]
    posed = [posed_span_s(robot) for robot in logs.robots]
    has_poses = all(span is not None for span in posed)
    spans = [span for span in posed if span is not None] if has_poses else logged
    start_s, end_s = max(start for start, _ in spans), min(end for _, end in spans)
    rate_hz = max(round(logs.rate_hz), 1)
    ticks = int(np.floor((end_s - start_s) * rate_hz + 1e-6)) + 1
    if ticks < 2:
        late, early = _names_at_ends(logs, spans)
        raise BadInput(logs.where, "", f"expected robots that ran at the same time: {late} began as {early} had ended")
    if ticks > MAX_TICKS:
        expected = f"expected at most {MAX_TICKS} common steps, got {ticks}: was a clock changed meanwhile?"
        raise BadInput(logs.where, "t_s", expected)
    notes = [*_cut(logs, spans, start_s, end_s), *_pose_notes(logs, (start_s, end_s), has_poses=has_poses)]
    return TimeBase(start_s, rate_hz, ticks, has_poses, tuple(notes))


def _names_at_ends(logs: RealLogs, spans: list[tuple[float, float]]) -> tuple[str, str]:
    starts, ends = [start for start, _ in spans], [end for _, end in spans]
    return logs.names[int(np.argmax(starts))], logs.names[int(np.argmin(ends))]


def _cut(logs: RealLogs, spans: list[tuple[float, float]], start_s: float, end_s: float) -> list[str]:
    """Return notes on parts of logs before the latest start and after the earliest end."""
    late, early = _names_at_ends(logs, spans)
    before_s, after_s = start_s - min(start for start, _ in spans), max(end for _, end in spans) - end_s
    notes: list[str] = []
    if before_s > MIN_CUT_S:
        notes.append(f"the first {before_s:.1f} s of other robots are left out: {late} began so late")
    if after_s > MIN_CUT_S:
        notes.append(f"the last {after_s:.1f} s of other robots are left out: {early} ended so early")
    return notes


def _pose_notes(logs: RealLogs, span: tuple[float, float], *, has_poses: bool) -> list[str]:
    if not has_poses:
        without = [robot.name for robot in logs.robots if posed_span_s(robot) is None]
        robots = "" if len(without) == len(logs.robots) else f" of {named(without)}"
        return [f"no poses{robots}: without a tracker, measures of positions are not in the log"]
    gaps = {robot.name: longest_gap_s(robot, span) for robot in logs.robots}
    wide = [f"{name} {gap_s:.1f} s" for name, gap_s in gaps.items() if gap_s > MIN_GAP_S]
    return [f"poses are missing for a while ({named(wide)}) and interpolated"] if wide else []


def posed_span_s(robot: RealRobotLog) -> Span | None:
    """Return the times of the first and the last step with a pose; None for fewer than two poses."""
    posed_s = robot.steps.time_s[_has_pose(robot)]
    return (float(posed_s[0]), float(posed_s[-1])) if len(posed_s) > 1 else None


def longest_gap_s(robot: RealRobotLog, span: Span) -> float:
    """Return the longest time without a pose within a span."""
    posed_s = robot.steps.time_s[_has_pose(robot)]
    within = posed_s[(posed_s > span[0]) & (posed_s < span[1])]
    return float(np.diff(within, prepend=span[0], append=span[1]).max())


def poses_at(robot: RealRobotLog, time_s: FloatArray, wrap: Wrap = (0.0, 0.0)) -> FloatArray:
    """Return poses (n, 3) at times (n,), linearly interpolated, headings the shorter way; NaN without any pose.

    Poses before the first and after the last are equal to these.
    """
    has_pose = _has_pose(robot)
    if not has_pose.any():
        return np.full((len(time_s), 3), np.nan)
    posed_s, pose = robot.steps.time_s[has_pose], robot.steps.pose[has_pose]
    columns = [
        _interpolated(time_s, posed_s, pose[:, column], period)
        for column, period in enumerate((*wrap, 2.0 * np.pi))  # periods of x and y lead across the seam of a torus
    ]
    return np.stack(columns, axis=1)


def _interpolated(time_s: FloatArray, value_s: FloatArray, value: FloatArray, period: float) -> FloatArray:
    if period == 0.0:
        return np.interp(time_s, value_s, value)
    unwrapped = np.interp(time_s, value_s, np.unwrap(value, period=period))
    return unwrapped - period * np.round(unwrapped / period)


def _has_pose(robot: RealRobotLog) -> AnyArray:
    return np.isfinite(robot.steps.pose[:, 0])
