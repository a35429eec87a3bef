"""Rotation: how far a swarm turns around its centroid, as in a mill."""

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

AT_THE_CENTROID_M = 1e-9  # nearer is rounding, and has no direction


@dataclass(frozen=True)
class Rotation(Metric):
    """|sum r_i x u_i| / N over the N robots alive: u_i unit heading, r_i unit vector from the centroid to the robot.

    1 when all head along circles around the centroid, one way round; 0 when they cancel, head outwards, or all one
    way. A robot at the centroid has no r_i and adds 0. A robot that drives backwards counts by where it looks. On a
    torus the centroid is taken from the circular mean of the places, and r_i is the shortest way (`centroid.py`): it
    means little unless the swarm is much smaller than the arena. NaN if no robot is alive, or without a centroid.

    Source: I. D. Couzin et al., Collective memory and spatial sorting in animal groups, J. Theor. Biol. 218 (2002),
    group angular momentum m_group, with headings for directions of motion.
    """

    name = "rotation"
    help = "rotation around the centroid: |sum of r x u| / robots alive, r to the robot, u its heading, unit vectors"
    bounds = (0.0, 1.0)

    def begin(self, static: Static) -> Measure:
        """A fresh measure; nothing is remembered."""
        wrap_m = sides_m(static)

        def measure(moment: Moment) -> FloatArray:
            away_m = from_centroid_m(moment.pose, moment.alive, wrap_m)
            return _rotation(away_m, *moment.direction, moment.alive)

        return measure


@njit()
def _rotation(away_m, c, s, alive):
    arenas, robots = alive.shape
    rotation = np.full(arenas, np.nan)
    for arena in range(arenas):
        total, n = 0.0, 0
        for i in range(robots):
            if alive[arena, i]:
                n += 1
                x, y = away_m[arena, i]
                length_m = np.sqrt(x * x + y * y)
                if not length_m <= AT_THE_CENTROID_M:  # NaN goes on
                    total += (x * s[arena, i] - y * c[arena, i]) / length_m
        if n and not np.isnan(total):
            rotation[arena] = min(abs(total) / n, 1.0)
    return rotation
