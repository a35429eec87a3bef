"""The smallest gap: how near two robots have come to each other."""

from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from scipy.spatial import KDTree

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure, Metric
from swarmwire.metrics.moment import Moment


@dataclass(frozen=True)
class MinGap(Metric):
    """Smallest distance in m between the surfaces of two robots alive: min of |p_i - p_j| - r_i - r_j.

    0 at a touch, and a little less while two press against each other; NaN with fewer than two robots alive. Its `min`
    in the summary is the nearest that two came in the run, as seen at the ticks.
    """

    name = "min_gap"
    help = "smallest distance between the surfaces of two robots alive, in m"
    unit = "m"
    bounds = (-np.inf, None)

    def begin(self, static: Static) -> Measure:
        """A fresh measure; nothing is remembered."""
        radius_m = np.concatenate([np.full(g.stop - g.start, g.body.radius_m) for g in static.groups])

        def measure(moment: Moment) -> FloatArray:
            arenas = zip(moment.position_m, moment.alive, strict=True)
            return np.array([smallest_gap_m(position[alive], radius_m[alive]) for position, alive in arenas])

        return measure


def smallest_gap_m(position_m: FloatArray, radius_m: FloatArray) -> float:
    """The smallest gap between discs at `position_m` (n, 2), NaN with less than two; O(n log n) per pair of radii."""
    gap_m = np.inf
    radii = np.unique(radius_m).tolist()
    for i, large in enumerate(radii):
        of = position_m[radius_m == large]
        tree = cast(Any, KDTree)(of)  # its stub types the answers in part only
        for small in radii[: i + 1]:
            # Among its own kind the nearest to a disc is the disc itself.
            nearest_m: FloatArray = tree.query(position_m[radius_m == small], k=[2 if small == large else 1])[0]
            gap_m = min(gap_m, float(np.min(nearest_m)) - large - small)
    return gap_m if np.isfinite(gap_m) else np.nan
