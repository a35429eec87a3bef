"""Where robots stand as seen from the centroid of their swarm. Compiled.

On a torus no mean of coordinates is a centroid. Taken is, along each axis, the circular mean of the places (the mean
direction of the angles 2 pi x / side), from which the places are unrolled by their shortest differences, and the mean
of those: a swarm that lies within half a side of that circular mean has the centroid that it would have on a plane.
Places that are spread so evenly that their directions cancel have none.
"""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray
from swarmwire.comms.geometry.obstacles import to_nearest
from swarmwire.comms.kernels import njit

CANCELLED = 1e-9  # a mean of directions shorter than this is rounding


@njit()
def from_centroid_m(pose: FloatArray, alive: BoolArray, wrap_m: tuple[float, float]) -> FloatArray:
    """Each robot's place less the centroid of the robots alive of its arena, (arenas, robots, 2).

    `wrap_m` are the sides of a torus, 0 where an arena ends; there differences are the shortest. NaN of the dead, and
    along an axis without a centroid.
    """
    arenas, robots = alive.shape
    away_m = np.full((arenas, robots, 2), np.nan)
    for arena in range(arenas):
        for axis in range(2):
            centre = _mean(pose[arena, :, axis], alive[arena], 0.0, 0.0)
            if wrap_m[axis] > 0.0:
                around = _circular_mean(pose[arena, :, axis], alive[arena], wrap_m[axis])
                centre = around + _mean(pose[arena, :, axis], alive[arena], around, wrap_m[axis])
            for i in range(robots):
                if alive[arena, i]:
                    away = pose[arena, i, axis] - centre
                    away_m[arena, i, axis] = away + to_nearest(away, wrap_m[axis])
    return away_m


@njit()
def _mean(at, alive, origin, side):
    """The mean of the shortest differences to `origin`; NaN if nobody is alive."""
    total, n = 0.0, 0
    for i in range(len(at)):
        if alive[i]:
            away = at[i] - origin
            total += away + to_nearest(away, side)
            n += 1
    return total / n if n else np.nan


@njit()
def _circular_mean(at, alive, side):
    """The place in the mean direction of the angles 2 pi at / side; NaN if they cancel, or nobody is alive."""
    turn, c, s, n = 2.0 * np.pi / side, 0.0, 0.0, 0
    for i in range(len(at)):
        if alive[i]:
            c += np.cos(turn * at[i])
            s += np.sin(turn * at[i])
            n += 1
    return np.arctan2(s, c) / turn if np.hypot(c, s) > CANCELLED * n else np.nan
