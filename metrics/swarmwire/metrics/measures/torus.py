"""Shortest displacements on a torus, the lines that show them, and paths that cross its seam."""

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, FloatArray, IntArray
from swarmwire.comms.observe.truth import Static


def sides_m(static: Static) -> tuple[float, float]:
    """Return the sides at which a torus wraps around, for the kernel `to_nearest`; 0 for an arena with a boundary."""
    return static.arena_size_m if static.boundary == "torus" else (0.0, 0.0)


def shortest_displacement(away_m: FloatArray, static: Static) -> FloatArray:
    """Return displacements (…, 2) in m, on a torus the shortest equivalents; values that are not finite stay."""
    if static.boundary != "torus":
        return away_m
    size_m = np.array(static.arena_size_m)
    finite_m = np.where(np.isfinite(away_m), away_m, 0.0)
    return away_m - size_m * np.floor(finite_m / size_m + 0.5)


def link_lines(position_m: FloatArray, ends: IntArray, static: Static) -> FloatArray:
    """Return lines (lines, 2, 2) between robots at `position_m` (n, 2), for pairs of robots, `ends` (k, 2).

    A line that crosses the seam of a torus is listed twice, after all others: from either end out of the arena.
    """
    start, end = position_m[ends[:, 0]], position_m[ends[:, 1]]
    if static.boundary != "torus":
        return np.stack([start, end], axis=1)
    away = shortest_displacement(end - start, static)
    crosses = np.any(np.abs(start + away - end) > 0.5 * min(static.arena_size_m), axis=1)
    into = np.stack([end - away, end], axis=1)
    return np.concatenate([np.stack([start, start + away], axis=1), into[crosses]])


def unwrap_path(position_m: AnyArray, static: Static) -> AnyArray:
    """Return a path of positions (points, …, 2) without jumps at the seam of a torus; its last point stays."""
    if static.boundary != "torus":
        return position_m
    steps = shortest_displacement(np.diff(position_m.astype(np.float64), axis=0), static)
    before = np.cumsum(steps[::-1], axis=0)[::-1]
    return np.concatenate([position_m[-1] - before, position_m[-1:]])
