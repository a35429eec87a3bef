"""Which ticks of a run become the frames of a film, and how fast they pass."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.errors import BadInput

MAX_BY_DEFAULT = 300  # frames
MAX_FRAMES = 20_000
_SPEEDS = (1, 2, 4, 5, 8, 10)  # times a power of ten


@dataclass(frozen=True)
class Footage:
    """The frames of a film."""

    ticks: IntArray  # (frames,) places in the film's arrays
    frames_per_s: float
    speed: float  # simulated seconds per second of film


def footage(
    time_s: FloatArray,
    rate_hz: float,
    from_s: float | None,
    until_s: float | None,
    frames_per_s: float | None,
    speed: float | None,
    usual_frames_per_s: float,
) -> Footage:
    """The frames between two times (both included), for a run with these ticks (T,) at this rate.

    Without a speed it is the slowest round one, real time at least, that needs no more than 300 frames. Without
    `frames_per_s` there are as many as usual, but no more than the run has ticks to show. BadInput if there is nothing
    between the two times, or too much for a film.
    """
    first, last = float(time_s[0]), float(time_s[-1])
    start, end = first if from_s is None else from_s, last if until_s is None else until_s
    for option, value in (("--from", start), ("--until", end)):
        if not first <= value <= last + 1.0 / rate_hz:
            raise BadInput(option, "", f"expected a time that was recorded, {first:g} to {last:g} s; got {value:g}")
    if start >= end and len(time_s) > 1:
        raise BadInput("--until", "", f"expected a time after --from, {start:g} s; got {end:g}")
    for option, value in (("--fps", frames_per_s), ("--speed", speed)):
        if value is not None and not 0 < value <= 1000:
            raise BadInput(option, "", f"expected a number above 0 and at most 1000, got {value:g}")
    wanted = frames_per_s or usual_frames_per_s
    chosen = speed or _speed(end - start, wanted)
    shown = frames_per_s or min(wanted, rate_hz * chosen)
    step_s = chosen / shown
    frames = _frames(end - start, step_s)
    if frames > MAX_FRAMES:
        raise BadInput("--speed", "", f"expected no more than {MAX_FRAMES} frames; {chosen:g} x makes {frames}")
    at_s = start + step_s * np.arange(frames)
    ticks = np.clip(np.searchsorted(time_s, at_s + 1e-6, side="right") - 1, 0, len(time_s) - 1)
    return Footage(ticks, shown, chosen)


def _speed(duration_s: float, frames_per_s: float) -> float:
    """The slowest round speed at which a duration needs no more frames than a film has by default."""
    power = 1.0
    while True:
        for factor in _SPEEDS:
            speed = factor * power
            if _frames(duration_s, speed / frames_per_s) <= MAX_BY_DEFAULT:
                return speed
        power *= 10.0


def _frames(duration_s: float, step_s: float) -> int:
    """How many there are, the first and what fits after it."""
    return int(duration_s / step_s + 1e-6) + 1
