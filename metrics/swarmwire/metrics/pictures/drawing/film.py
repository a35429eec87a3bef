"""The data of pictures and films: an arena of a run, tick by tick, and the ticks of a film's frames."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import polars as pl

from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.observe.truth import Static
from swarmwire.metrics.measures.metric import MetricInfo
from swarmwire.metrics.measures.registry import LINK_PDR
from swarmwire.metrics.records.run_folder.layout import MOVABLE
from swarmwire.metrics.records.run_folder.reader import RunFolder

NO_STATE = -1
MAX_BY_DEFAULT = 300  # frames
MAX_FRAMES = 20_000
_SPEEDS = (1, 2, 4, 5, 8, 10)  # times a power of ten


@dataclass(frozen=True)
class Film:
    """An arena of a run, tick by tick, for T ticks and n robots."""

    static: Static
    arena: int
    time_s: FloatArray  # (T,) ascending
    pose: AnyArray  # (T, n, 3) x, y in m, heading in rad, arena frame
    alive: BoolArray  # (T, n)
    metrics: dict[str, FloatArray]  # (T,) each, NaN where undefined
    state: IntArray | None = None  # (T, n) indices in `state_names`, or NO_STATE; None if no robot has a state
    state_names: tuple[str, ...] = ()
    facts: Mapping[str, MetricInfo] = field(default_factory=dict[str, MetricInfo])  # facts on metrics by name
    movable: AnyArray | None = None  # (T, k, 3) poses of movable obstacles; None: no movable obstacles

    def movable_at(self, index: int) -> tuple[Obstacle, ...]:
        """Return the movable obstacles at a tick."""
        return () if self.movable is None else self.static.movable_at(self.arena, self.movable[index])

    def index_at(self, time_s: float) -> int:
        """Return the last tick that has begun at this time, or the first tick."""
        return max(0, int(np.searchsorted(self.time_s, time_s + 1e-9, side="right")) - 1)


def film_of(recorded: RunFolder, arena: int, where: str) -> Film:
    """Return the film of an arena; BadInput names `where` without such an arena, or before its first tick."""
    static = recorded.static
    if not 0 <= arena < static.arenas:
        raise BadInput(where, "arena", f"expected 0 to {static.arenas - 1}, got {arena}")
    frame = recorded.ticks(arena).sort("tick")
    if frame.is_empty():
        raise BadInput(where, "", "holds no tick yet")
    pose = _stacked(frame, ("x_m", "y_m", "heading_rad"))
    names, state = states(frame)
    return Film(
        static=static,
        arena=arena,
        time_s=frame["time_s"].to_numpy(),
        pose=pose,
        alive=frame["alive"].to_numpy(),
        metrics=_metrics(frame, static.rate_hz),
        state=state,
        state_names=names,
        facts=recorded.measured,
        movable=_stacked(frame, MOVABLE) if static.movable else None,
    )


def _stacked(frame: pl.DataFrame, names: tuple[str, ...]) -> AnyArray:
    """Return columns of lists as an array, (T, items, columns)."""
    return np.stack([frame[name].to_numpy() for name in names], axis=-1)


def states(frame: pl.DataFrame) -> tuple[tuple[str, ...], IntArray | None]:
    """Return the names of the robots' states by first tick, and their indices (T, n), or None without any state.

    Null and the empty text have the index NO_STATE.
    """
    texts = frame["state"].explode()
    names = [name for name in texts.unique(maintain_order=True).to_list() if name]
    if not names:
        return (), None
    index = texts.cast(pl.Enum(names), strict=False).to_physical().cast(pl.Int64).fill_null(NO_STATE)
    return tuple(names), index.to_numpy().reshape(frame.height, -1)


def _metrics(frame: pl.DataFrame, rate_hz: int) -> dict[str, FloatArray]:
    """Return the columns with a number per tick, and `link_pdr`: received / in range over the last second."""
    names = [name for name, kind in frame.schema.items() if kind == pl.Float64 and name != "time_s"]
    metrics: dict[str, FloatArray] = {name: frame[name].fill_null(np.nan).to_numpy() for name in names}
    if LINK_PDR not in metrics and {"received", "in_range"} <= set(frame.columns):
        received, in_range = (
            frame[name].cast(pl.Float64).rolling_sum(rate_hz, min_samples=1).fill_null(np.nan).to_numpy()
            for name in ("received", "in_range")
        )
        metrics[LINK_PDR] = np.divide(received, in_range, out=np.full(len(received), np.nan), where=in_range > 0)
    return metrics


@dataclass(frozen=True)
class Footage:
    """The frames of a film."""

    ticks: IntArray  # (frames,) indices in the film's arrays
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
    """Return the frames between two times (both included), for a run with these ticks (T,) at this rate.

    The default speed is the slowest round speed, at least real time, that needs no more than 300 frames. The default
    `frames_per_s` is the usual one, but at most one frame per tick. BadInput without a tick between the two times, or
    for too many frames.
    """
    first, last = float(time_s[0]), float(time_s[-1])
    start, end = first if from_s is None else from_s, last if until_s is None else until_s
    for option, value in (("--from", start), ("--until", end)):
        if not first <= value <= last + 1.0 / rate_hz:
            raise BadInput(option, "", f"expected a recorded time, {first:g} to {last:g} s; got {value:g}")
    if start >= end and len(time_s) > 1:
        raise BadInput("--until", "", f"expected a time after --from, {start:g} s; got {end:g}")
    for option, value in (("--fps", frames_per_s), ("--speed", speed)):
        if value is not None and not 0 < value <= 1000:
            raise BadInput(option, "", f"expected a number above 0 and at most 1000, got {value:g}")
    max_frames_per_s = frames_per_s or usual_frames_per_s
    speed = speed or _default_speed(end - start, max_frames_per_s)
    frames_per_s = frames_per_s or min(max_frames_per_s, rate_hz * speed)
    step_s = speed / frames_per_s
    frames = _frames(end - start, step_s)
    if frames > MAX_FRAMES:
        raise BadInput("--speed", "", f"expected no more than {MAX_FRAMES} frames; {speed:g} x makes {frames}")
    frame_time_s = start + step_s * np.arange(frames)
    ticks = np.clip(np.searchsorted(time_s, frame_time_s + 1e-6, side="right") - 1, 0, len(time_s) - 1)
    return Footage(ticks, frames_per_s, speed)


def _default_speed(duration_s: float, frames_per_s: float) -> float:
    """Return the slowest round speed that needs no more than MAX_BY_DEFAULT frames."""
    power = 1.0
    while True:
        for factor in _SPEEDS:
            speed = factor * power
            if _frames(duration_s, speed / frames_per_s) <= MAX_BY_DEFAULT:
                return speed
        power *= 10.0


def _frames(duration_s: float, step_s: float) -> int:
    """Return the number of frames, the first included."""
    return int(duration_s / step_s + 1e-6) + 1
