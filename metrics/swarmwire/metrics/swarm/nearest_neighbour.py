"""The distance to the nearest neighbour: how far apart robots stand."""

# pyright: basic, reportUnknownMemberType=false

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.geometry.obstacles import to_nearest
from swarmwire.comms.kernels import kernel, njit
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure, Metric
from swarmwire.metrics.moment import Moment
from swarmwire.metrics.swarm.strips import along_m, fill, first_order, place_at, room_for
from swarmwire.metrics.torus import sides_m


@dataclass(frozen=True)
class NearestNeighbour(Metric):
    """Mean over the robots i alive of min over the others j alive of |x_i - x_j| in m, centre to centre.

    The shortest way on a torus. Of robots at random on a large plane, n to the square metre, it is 1 / (2 sqrt(n)), and
    at most 1.0746 / sqrt(n), which a hexagonal lattice has; what is below the first is clustered. NaN with fewer than
    two robots alive.

    Source: P. J. Clark, F. C. Evans, Distance to nearest neighbor as a measure of spatial relationships in populations,
    Ecology 35 (1954).
    """

    name = "nearest_neighbour"
    help = "mean distance from a robot alive to the nearest other one, centre to centre, in m"
    unit = "m"
    bounds = (0.0, None)

    def begin(self, static: Static) -> Measure:
        """A fresh measure; what it remembers only makes it quick."""
        order, strips, wrap_m = first_order(static), room_for(static), sides_m(static)

        def measure(moment: Moment) -> FloatArray:
            return _mean_nearest_m(moment.pose, moment.alive, order, strips, wrap_m)

        return measure


@njit()
def _mean_nearest_m(pose, alive, order, strips, wrap_m):
    """From each robot strip by strip outwards, until the sides of the next ones are farther than the nearest so far."""
    mean_m = np.full(len(order), np.nan)
    for arena in range(len(order)):
        n = np.sum(alive[arena])
        count, low_m, height_m = fill(strips, order[arena], pose[arena], alive[arena], 0.0, int(np.sqrt(n)), wrap_m[1])
        total_m = 0.0
        for a in range(n):
            own = strips.strip[a]
            up_m = strips.y[a] - (low_m + own * height_m)  # above the lower side of its strip
            nearest = _nearest_square(strips, a, own, np.inf, wrap_m)
            for away in range(1, count // 2 + 1 if wrap_m[1] > 0.0 else count):
                between_m = (away - 1) * height_m
                if between_m * between_m >= nearest:
                    break
                for other, to_m in ((own - away, up_m + between_m), (own + away, height_m - up_m + between_m)):
                    s = other % count if wrap_m[1] > 0.0 else other
                    if 0 <= s < count and to_m * to_m < nearest:
                        nearest = _nearest_square(strips, a, s, nearest, wrap_m)
            total_m += np.sqrt(nearest)
        if n > 1:
            mean_m[arena] = total_m / n
    return mean_m


@kernel()
def _nearest_square(strips, a, s, nearest, wrap_m):
    """The least of `nearest` and the squared distances from place a to the others of strip s: either way along x."""
    low, size = strips.start[s], strips.start[s + 1] - strips.start[s]
    here = _first_from(strips.x, low, low + size, strips.x[a]) - low
    right, left = (here + size, here - 1 - size) if wrap_m[0] > 0.0 else (size, -1)
    for begin, end, step in ((here, right, 1), (here - 1, left, -1)):
        for v in range(begin, end, step):
            along, b = along_m(strips, a, low, size, v, wrap_m[0]), place_at(low, size, v)
            if along * along >= nearest:
                break
            if b != a:
                across = strips.y[b] - strips.y[a]
                across += to_nearest(across, wrap_m[1])
                nearest = min(nearest, along * along + across * across)
    return nearest


@kernel()
def _first_from(x, low, high, least):
    """The first of the places low to high - 1, sorted by x, that is not left of `least`; high if all are."""
    while low < high:
        middle = (low + high) // 2
        if x[middle] < least:
            low = middle + 1
        else:
            high = middle
    return low
