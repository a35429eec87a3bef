"""Aggregation: the share of the swarm in its largest cluster, and the time at which most robots were together."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.comms.base.clock import NS_PER_S, to_ns
from swarmwire.comms.base.config import parameter
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.observe.truth import Static
from swarmwire.metrics.measures.metric import Measure, Metric, TickView, components_of, neighbours_of
from swarmwire.metrics.measures.swarm.pairs import NearPairs, radii_m

NOT_YET = -1


@dataclass(frozen=True)
class ClosePairsMetric(Metric):
    """A metric of pairs of robots alive with a gap of less than `gap_m` between their surfaces, seen from above.

    The gap of two robots is |x_i - x_j| - r_i - r_j, the shortest way on a torus, ignoring heights: from surface
    to surface, since the centres of two discs that touch are a diameter apart.
    """

    gap_m: float | None = parameter(
        None,
        help="robots with less between their surfaces are together; left out: the diameter of one, or the mean of both",
        unit="m",
        above=0.0,
    )

    def close_pairs(self, static: Static) -> NearPairs:
        """Return a finder of those pairs."""
        radius_m = radii_m(static)
        return NearPairs(static, 2.0 * radius_m if self.gap_m is None else radius_m + 0.5 * self.gap_m)


@dataclass(frozen=True)
class AggregationRatio(ClosePairsMetric):
    """Robots alive in the largest cluster / robots alive, 1/N to 1; NaN if none is alive.

    A cluster is a connected component of the graph that joins two robots alive with less than `gap_m` from surface to
    surface, by default a robot's diameter: a chain is one cluster. `aggregation_hop` follows one edge only. For mixed
    bodies the default gap of a pair is the mean of both diameters, so that at most touching robots of their size fit
    between.

    Source: the largest cluster of M. Gauci et al., IJRR 33 (2014), with the gap of `aggregation_hop`.
    """

    name = "aggregation"
    help = "robots alive in the largest cluster (steps of less than a gap between surfaces) / robots alive"
    bounds = (0.0, 1.0)

    def begin(self, static: Static) -> Measure:
        """Return a measure; its memory only makes it quick."""
        pairs = self.close_pairs(static)

        def measure(view: TickView) -> FloatArray:
            return components_of(pairs.find(view), view.alive).largest / view.per_robot_alive

        return measure


@dataclass(frozen=True)
class AggregationHop(ClosePairsMetric):
    """Robots alive in the largest flock / robots alive, 1/N to 1, with flocks of one hop; NaN if none is alive.

    For each robot alive that is in no flock yet, by rising index: open a flock with it and all robots alive whose
    surface is less than `gap_m` from its surface, by default a robot's diameter. As in the source, a robot can be in
    several flocks; a flock is a star around the robot that opened it, not a connected component; and the robots that
    open flocks depend on the numbering. `aggregation` depends on no numbering, and is never less: a chain of five is
    one cluster there, and flocks of two and three here.

    Source: Algorithm 1 of a study of flocking and search in the ARGoS simulator, which multiplies this by 100 and calls
    the threshold one robot dimension.
    """

    name = "aggregation_hop"
    help = "robots alive in the largest flock of one hop (Algorithm 1, gaps between surfaces) / robots alive"
    bounds = (0.0, 1.0)

    def begin(self, static: Static) -> Measure:
        """Return a measure; its memory only makes it quick."""
        pairs = self.close_pairs(static)

        def measure(view: TickView) -> FloatArray:
            return largest_flock(pairs.find(view), view.alive) / view.per_robot_alive

        return measure


@njit()
def largest_flock(pairs: IntArray, alive: BoolArray) -> FloatArray:
    """Return the number of robots in the largest flock of each arena, (arenas,).

    `pairs` (k, 2) are rows of robots that are close, each pair once; `alive` is (arenas, robots).
    """
    arenas, robots = alive.shape
    start, close = neighbours_of(pairs, arenas * robots)
    largest, in_flock = np.zeros(arenas), np.zeros(arenas * robots, np.bool_)
    for arena in range(arenas):
        for i in range(robots):
            row = arena * robots + i
            if alive[arena, i] and not in_flock[row]:
                others = close[start[row] : start[row + 1]]
                in_flock[row] = True
                for other in others:
                    in_flock[other] = True
                largest[arena] = max(largest[arena], 1 + len(others))
    return largest


@dataclass(frozen=True)
class AggregationTime(ClosePairsMetric):
    """First time in s from which the largest cluster contained ceil(share N) of the N robots alive for `hold_s`.

    Clusters are those of `aggregation`, or with `reading = "hop"` the flocks of one hop of `aggregation_hop`. The time
    is the start of the first stretch of `hold_s`, 0 for a swarm that starts together; NaN until that stretch is
    complete, the same from then on. Ticks without a robot alive end a stretch. With few robots shares are coarse: 0.8
    requires 4 of 5.

    Source: studies of aggregation report the time to a share of robots in one flock; the hold time is our addition.
    """

    share: float = parameter(0.8, help="of the robots alive, in the largest cluster", above=0.0, at_most=1.0)
    reading: str = parameter(
        "cluster",
        choices=("cluster", "hop"),
        help="who is together: all who can be reached by steps of less than the gap, or within one step of one robot",
    )
    hold_s: float = parameter(0.0, help="for how long", unit="s", at_least=0.0)

    name = "aggregation_time_s"
    help = "start of the first stretch in which the largest cluster held a share of the robots alive for long, in s"
    unit = "s"
    kind = "time"
    bounds = (0.0, None)

    def begin(self, static: Static) -> Measure:
        """Return a measure that keeps the start of the present stretch and the result."""
        cluster_size = largest_flock if self.reading == "hop" else _largest_cluster
        pairs, hold_ns = self.close_pairs(static), to_ns(self.hold_s)
        since_ns: IntArray = np.full(static.arenas, NOT_YET, np.int64)
        time_s: FloatArray = np.full(static.arenas, np.nan)

        def measure(view: TickView) -> FloatArray:
            if np.isnan(time_s).any():
                is_enough = cluster_size(pairs.find(view), view.alive) >= view.robots_for(self.share)
                _update_stretches(is_enough, view.truth.time_ns, hold_ns, since_ns, time_s)
            return time_s

        return measure


def _largest_cluster(pairs: IntArray, alive: BoolArray) -> IntArray:
    """Return the number of robots in the largest cluster of each arena, (arenas,)."""
    return components_of(pairs, alive).largest


@njit()
def _update_stretches(is_enough: AnyArray, now_ns: int, hold_ns: int, since_ns: AnyArray, time_s: AnyArray):
    """Record the start of each stretch in `since_ns`, and of the first long one in `time_s`."""
    for arena in range(len(is_enough)):
        if not is_enough[arena]:
            since_ns[arena] = NOT_YET
        elif since_ns[arena] == NOT_YET:
            since_ns[arena] = now_ns
        if is_enough[arena] and np.isnan(time_s[arena]) and now_ns - since_ns[arena] >= hold_ns:
            time_s[arena] = since_ns[arena] / NS_PER_S
