"""Cohesion: the radius of the swarm around its centroid."""

# pyright: basic, reportUnknownMemberType=false

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.kernels import njit
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure, Metric
from swarmwire.metrics.moment import Moment
from swarmwire.metrics.swarm.centroid import from_centroid_m
from swarmwire.metrics.torus import sides_m


@dataclass(frozen=True)
class Cohesion(Metric):
    """max |x_i - c| in m over the robots alive, c their centroid; 0 for one robot alone, NaN if none is alive.

    The radius of the least circle around the centroid that holds all centres: the smaller, the more cohesive. One robot
    that stays behind decides it; `dispersion` weighs all. On a torus the centroid is taken from the circular mean of
    the places, distances are the shortest (`centroid.py`), and what has no centroid is NaN.

    Source: R. Olfati-Saber, Flocking for multi-agent dynamic systems, IEEE TAC 51 (2006), section IX: cohesion radius.
    """

    name = "cohesion"
    help = "largest distance of a robot alive to the centroid of those alive, in m"
    unit = "m"
    bounds = (0.0, None)

    def begin(self, static: Static) -> Measure:
        """A fresh measure; nothing is remembered."""
        wrap_m = sides_m(static)

        def measure(moment: Moment) -> FloatArray:
            return _largest(from_centroid_m(moment.pose, moment.alive, wrap_m), moment.alive)

        return measure


@njit()
def _largest(away_m, alive):
    arenas, robots = alive.shape
    largest_m = np.full(arenas, np.nan)
    for arena in range(arenas):
        most, n = 0.0, 0
        for i in range(robots):
            if alive[arena, i]:
                square = away_m[arena, i, 0] ** 2 + away_m[arena, i, 1] ** 2
                most = square if np.isnan(square) else max(most, square)
                n += 1
        if n:
            largest_m[arena] = np.sqrt(most)
    return largest_m
