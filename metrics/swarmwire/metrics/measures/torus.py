"""The shortest way on a torus: displacements between places, lines that show them, and paths that cross its seam."""

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, FloatArray, IntArray
from swarmwire.comms.observe.truth import Static


def sides_m(static: Static) -> tuple[float, float]:
    """The sides at which a torus wraps around, 0 where an arena ends, as the kernel `to_nearest` takes them."""
    return static.arena_size_m if static.boundary == "torus" else (0.0, 0.0)


def shortest(away_m: FloatArray, static: Static) -> FloatArray:
    """Displacements (…, 2) in m between places of an arena, on a torus those the shortest way; not finite ones stay."""
    if static.boundary != "torus":
        return away_m
    size_m = np.array(static.arena_size_m)
    finite_m = np.where(np.isfinite(away_m), away_m, 0.0)
    return away_m - size_m * np.floor(finite_m / size_m + 0.5)


def link_lines(position_m: FloatArray, ends: IntArray, static: Static) -> FloatArray:
    """Lines (lines, 2, 2) between robots at `position_m` (n, 2), for pairs of them, `ends` (k, 2).

    One that crosses the seam of a torus is there twice, after all others: from either end out of the arena.
    """
    start, end = position_m[ends[:, 0]], position_m[ends[:, 1]]
    if static.boundary != "torus":
        return np.stack([start, end], axis=1)
    away = shortest(end - start, static)
    crosses = np.any(np.abs(start + away - end) > 0.5 * min(static.arena_size_m), axis=1)
    into = np.stack([end - away, end], axis=1)
    return np.concatenate([np.stack([start, start + away], axis=1), into[crosses]])


def whole_path(place_m: AnyArray, static: Static) -> AnyArray:
    """A path of places (points, …, 2), the oldest first; on a torus one that ends where it did, without jumps."""
    if static.boundary != "torus":
        return place_m
    steps = shortest(np.diff(place_m.astype(np.float64), axis=0), static)
    before = np.cumsum(steps[::-1], axis=0)[::-1]
    return np.concatenate([place_m[-1] - before, place_m[-1:]])
