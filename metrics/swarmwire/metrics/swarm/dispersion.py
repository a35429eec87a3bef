"""Dispersion: how far a swarm is from standing as densely as it could."""

# pyright: basic, reportUnknownMemberType=false

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.kernels import njit
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure, Metric
from swarmwire.metrics.moment import Moment
from swarmwire.metrics.swarm.centroid import from_centroid_m
from swarmwire.metrics.swarm.radii import radii_m
from swarmwire.metrics.torus import sides_m


@dataclass(frozen=True)
class Dispersion(Metric):
    """sum |x_i - c|^2 / (4 r^2) over the robots alive: second moment about their centroid c, in squared diameters.

    The least is that of the densest packing, near a hexagonal one, of as many discs: 6 for 7 of them, 48 for 19. It
    grows with the square of their number even so: compare it with that, or runs with equally many robots. r is the
    radius of the body; of mixed bodies r^2 is the mean of their squares over the robots alive. On a torus the centroid
    is taken from the circular mean of the places, distances are the shortest (`centroid.py`), and what has no centroid
    is NaN; so is an arena in which no robot is alive.

    Source: M. Gauci et al., Self-organized aggregation without computation, IJRR 33 (2014), eq. 1.
    """

    name = "dispersion"
    help = "dispersion: sum of squared distances to the centroid / (4 r^2), over robots alive"
    bounds = (0.0, None)

    def begin(self, static: Static) -> Measure:
        """A fresh measure; nothing is remembered."""
        wrap_m, radius_m = sides_m(static), radii_m(static)

        def measure(moment: Moment) -> FloatArray:
            return _dispersion(from_centroid_m(moment.pose, moment.alive, wrap_m), radius_m, moment.alive)

        return measure


@njit()
def _dispersion(away_m, radius_m, alive):
    arenas, robots = alive.shape
    dispersion = np.full(arenas, np.nan)
    for arena in range(arenas):
        moment, squares, n = 0.0, 0.0, 0
        for i in range(robots):
            if alive[arena, i]:
                moment += away_m[arena, i, 0] ** 2 + away_m[arena, i, 1] ** 2
                squares += radius_m[i] ** 2
                n += 1
        if n:
            dispersion[arena] = moment / (4.0 * squares / n)
    return dispersion
