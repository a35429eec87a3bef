"""Local order: how far each robot's heading agrees with those of its neighbours."""

# pyright: basic, reportUnknownMemberType=false

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.config import parameter
from swarmwire.comms.kernels import njit
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure, Metric
from swarmwire.metrics.moment import Moment
from swarmwire.metrics.swarm.near_pairs import NearPairs


@dataclass(frozen=True)
class OrderLocal(Metric):
    """Mean over the robots i alive of the mean over their neighbours j of cos(heading_i - heading_j), -1 to 1.

    Neighbours are the other robots alive nearer than `range_m`, centre to centre, the shortest way on a torus. A robot
    without any counts 1, as in the source; so a swarm that has scattered looks ordered: read it with
    `nearest_neighbour`. Groups that agree each within itself have 1 however they differ, where `order` has less.
    Near 0 for headings at random; NaN if no robot is alive.

    Source: the order metric of E. Soria et al., SwarmLab (IROS 2020), with headings for directions of velocities,
    which robots at rest have not, and a range alone, without a largest number of neighbours.
    """

    range_m: float = parameter(1.0, help="who is nearer is a neighbour", unit="m", above=0.0)

    name = "order_local"
    help = "local order: mean of the cosines between a robot's heading and those of its neighbours, over robots alive"
    bounds = (-1.0, 1.0)

    def begin(self, static: Static) -> Measure:
        """A fresh measure; what it remembers only makes it quick."""
        neighbours = NearPairs(static, np.full(static.robots, 0.5 * self.range_m))

        def measure(moment: Moment) -> FloatArray:
            return _order_local(*moment.direction, moment.alive, neighbours.of(moment))

        return measure


@njit()
def _order_local(c, s, alive, pairs):
    arenas, robots = alive.shape
    c, s = c.ravel(), s.ravel()
    total, neighbours = np.zeros(arenas * robots), np.zeros(arenas * robots, np.int64)
    for k in range(len(pairs)):
        i, j = pairs[k]
        agree = c[i] * c[j] + s[i] * s[j]
        total[i] += agree
        total[j] += agree
        neighbours[i] += 1
        neighbours[j] += 1
    order = np.full(arenas, np.nan)
    for arena in range(arenas):
        sum_of_means, n = 0.0, 0
        for i in range(robots):
            row = arena * robots + i
            if alive[arena, i]:
                sum_of_means += total[row] / neighbours[row] if neighbours[row] else 1.0
                n += 1
        if n:
            order[arena] = min(max(sum_of_means / n, -1.0), 1.0)  # rounding may carry it just past
    return order
