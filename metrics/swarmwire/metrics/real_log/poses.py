"""Poses of a robot at any time, between those that the tracker told."""

import numpy as np

from swarmwire.comms.arrays import AnyArray, FloatArray
from swarmwire.metrics.real_log.robot_log import RobotLog

GAP_S = 1.0  # without a pose, from which on it is worth a word

Span = tuple[float, float]  # times in s, from the first to the last
Wrap = tuple[float, float]  # a torus's width and height in m; 0: none


def posed_span_s(robot: RobotLog) -> Span | None:
    """From the first to the last step at which the tracker knew the robot; None if it never did, or once alone."""
    known_s = robot.steps.time_s[_known(robot)]
    return (float(known_s[0]), float(known_s[-1])) if len(known_s) > 1 else None


def longest_gap_s(robot: RobotLog, span: Span) -> float:
    """The longest time without a pose within a span."""
    known_s = robot.steps.time_s[_known(robot)]
    within = known_s[(known_s > span[0]) & (known_s < span[1])]
    return float(np.diff(within, prepend=span[0], append=span[1]).max())


def poses_at(robot: RobotLog, time_s: FloatArray, wrap: Wrap = (0.0, 0.0)) -> FloatArray:
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


def _known(robot: RobotLog) -> AnyArray:
    return np.isfinite(robot.steps.pose[:, 0])
