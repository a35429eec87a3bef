"""The time that all robots' logs have in common: from the latest start to the earliest end."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.clock import NS_PER_S, tick_start_ns
from swarmwire.comms.errors import BadInput
from swarmwire.metrics.real_log.poses import GAP_S, longest_gap_s, posed_span_s
from swarmwire.metrics.real_log.real_logs import RealLogs, named
from swarmwire.metrics.real_log.robot_log import TICKS

MAX_TICKS = 5_000_000  # which still fit the memory: days of steps
CUT_S = 1.0  # of a robot's log, from which on what is left out is worth a word


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
        return [f"no poses{some}: without a tracker, what rests on positions is not in the log"]
    gaps = {robot.name: longest_gap_s(robot, span) for robot in logs.robots}
    wide = [f"{name} {gap_s:.1f} s" for name, gap_s in gaps.items() if gap_s > GAP_S]
    return [f"poses are missing for a while ({named(wide)}) and drawn straight through"] if wide else []
