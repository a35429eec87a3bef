"""One arena of a run, tick by tick, as pictures and films draw it, and the ticks that become the frames of a film."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import polars as pl

from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.observe.truth import Static
from swarmwire.metrics.measures.registry import LINK_PDR
from swarmwire.metrics.records.run_folder.layout import MOVABLE, MetricInfo
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
    time_s: FloatArray  # (T,) rising
    pose: AnyArray  # (T, n, 3) x, y in m, heading in rad, arena frame
    alive: BoolArray  # (T, n)
    metrics: dict[str, FloatArray]  # (T,) each, NaN where undefined
    state: IntArray | None = None  # (T, n) places in `state_names`, NO_STATE for none; None if no robot has any
    state_names: tuple[str, ...] = ()
    # of the run's metrics, by name
    facts: Mapping[str, MetricInfo] = field(default_factory=dict[str, MetricInfo])
    movable: AnyArray | None = None  # (T, k, 3) where movable obstacles were; None: there are none

    def movable_at(self, index: int) -> tuple[Obstacle, ...]:
        """The movable obstacles at a tick."""
        return () if self.movable is None else self.static.movable_at(self.arena, self.movable[index])

    def index_at(self, time_s: float) -> int:
        """The last tick that had begun by then; the first if none had."""
        return max(0, int(np.searchsorted(self.time_s, time_s + 1e-9, side="right")) - 1)


def film_of(recorded: RunFolder, arena: int, where: str) -> Film:
    """The film of one arena; BadInput names `where` if there is no such arena, or no tick of it yet."""
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
    """Columns of lists as one array, (T, items, columns)."""
    return np.stack([frame[name].to_numpy() for name in names], axis=-1)


def states(frame: pl.DataFrame) -> tuple[tuple[str, ...], IntArray | None]:
    """The names of the states that robots noted, in order of their first tick, and each robot's state.

    Null and the empty text are no state. Second: (T, n) places in the names or NO_STATE, or None if no robot ever noted
    a state.
    """
    texts = frame["state"].explode()
    names = [name for name in texts.unique(maintain_order=True).to_list() if name]
    if not names:
        return (), None
    place = texts.cast(pl.Enum(names), strict=False).to_physical().cast(pl.Int64).fill_null(NO_STATE)
    return tuple(names), place.to_numpy().reshape(frame.height, -1)


def _metrics(frame: pl.DataFrame, rate_hz: int) -> dict[str, FloatArray]:
    """The columns that hold one number a tick, and `link_pdr`: received / in range, over the last second."""
    names = [name for name, kind in frame.schema.items() if kind == pl.Float64 and name != "time_s"]
    found: dict[str, FloatArray] = {name: frame[name].fill_null(np.nan).to_numpy() for name in names}
    if LINK_PDR not in found and {"received", "in_range"} <= set(frame.columns):
        received, in_range = (
            frame[name].cast(pl.Float64).rolling_sum(rate_hz, min_samples=1).fill_null(np.nan).to_numpy()
            for name in ("received", "in_range")
        )
        found[LINK_PDR] = np.divide(received, in_range, out=np.full(len(received), np.nan), where=in_range > 0)
    return found


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
    at_most = frames_per_s or usual_frames_per_s
    chosen = speed or _speed(end - start, at_most)
    shown = frames_per_s or min(at_most, rate_hz * chosen)
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
    """The number of frames: the first, and those that fit after it."""
    return int(duration_s / step_s + 1e-6) + 1
