"""The ways of robots over a run, as few lines as show them."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import AnyArray, FloatArray, IntArray
from swarmwire.comms.truth import Static
from swarmwire.metrics.torus import whole_path

MAX_PATHS = 1000
MAX_POINTS = 30_000  # of all paths together: half a megabyte of a figure
_MIN_TICKS = 24


@dataclass(frozen=True)
class Paths:
    """Places of robots at some ticks: of all robots and ticks, or of as many as can be drawn."""

    robots: IntArray  # (m,) rising, of all n
    ticks: IntArray  # (k,) places among the T ticks, the first and the last among them
    place_m: FloatArray  # (k, m, 2)
    lap: IntArray  # (k, m, 2) how often the seam of a torus was crossed, along and across; 0 without one

    def line(self, columns: IntArray, first: int, last: int) -> tuple[FloatArray, FloatArray]:
        """The ways, x and y, of these columns from one place in `ticks` to another, NaN where the pen is lifted."""
        place, lap = self.place_m[first : last + 1, columns], self.lap[first : last + 1, columns]
        jump = (np.diff(lap, axis=0) != 0).any(axis=-1)  # (k - 1, m)
        drawn = np.full((2 * len(place), len(columns), 2), np.nan)
        drawn[0:-1:2] = place
        # Between two places stands the second again, which changes nothing, or a gap.
        drawn[1:-1:2] = np.where(jump[..., None], np.nan, place[1:])
        along = drawn.swapaxes(0, 1).reshape(-1, 2)
        twice = np.zeros(len(along), np.bool_)
        twice[1:] = (along[1:] == along[:-1]).all(axis=1)
        return along[~twice, 0], along[~twice, 1]


def paths_of(place_m: AnyArray, static: Static) -> Paths:
    """The paths to draw of robots at `place_m` (T, n, 2)."""
    ticks, robots = place_m.shape[:2]
    drawn = _evenly(robots, MAX_PATHS)
    kept = _evenly(ticks, max(_MIN_TICKS, MAX_POINTS // max(1, len(drawn))))
    own = place_m[:, drawn].astype(np.float64)
    lap = np.zeros(own.shape, np.int64)
    if static.boundary == "torus":
        lap = np.round((whole_path(own, static) - own) / np.array(static.arena_size_m)).astype(np.int64)
    return Paths(drawn, kept, own[kept], lap[kept])


def _evenly(count: int, most: int) -> IntArray:
    """All of so many, or `most` of them, evenly, with the first and the last."""
    if count <= most:
        return np.arange(count)
    return np.unique(np.round(np.linspace(0, count - 1, most)).astype(np.int64))
