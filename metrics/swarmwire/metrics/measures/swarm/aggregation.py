"""Aggregation: the share of the swarm in its largest cluster, and when most of it had come together."""

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
class OfClosePairs(Metric):
    """A metric of the robots alive between whose surfaces there are less than `gap_m`, as seen from above.

    The gap of two robots is |x_i - x_j| - r_i - r_j, the shortest way on a torus, ignoring heights: from surface
    to surface, since the centres of two discs that touch are a diameter apart already.
    """

    gap_m: float | None = parameter(
        None,
        help="robots with less between their surfaces are together; left out: the diameter of one, or the mean of both",
        unit="m",
        above=0.0,
    )

    def close_pairs(self, static: Static) -> NearPairs:
        """A finder of those pairs."""
        radius_m = radii_m(static)
        return NearPairs(static, 2.0 * radius_m if self.gap_m is None else radius_m + 0.5 * self.gap_m)


@dataclass(frozen=True)
class AggregationRatio(OfClosePairs):
    """Robots alive in the largest cluster / robots alive, 1/N to 1; NaN if none is alive.

    A cluster is a connected component of the graph that joins two robots alive with less than `gap_m` from surface to
    surface, by default a robot's diameter: every robot that such steps reach belongs to it, so a chain is one
    cluster. `aggregation_hop` takes one step only. Of mixed bodies the default gap of a pair is the mean of both
    diameters, so that at most touching robots of their size fit between.

    Source: the largest cluster of M. Gauci et al., IJRR 33 (2014), with the gap of `aggregation_hop`.
    """

    name = "aggregation"
    help = "robots alive in the largest cluster (steps of less than a gap between surfaces) / robots alive"
    bounds = (0.0, 1.0)

    def begin(self, static: Static) -> Measure:
        """A fresh measure; what it remembers only makes it quick."""
        pairs = self.close_pairs(static)

        def measure(view: TickView) -> FloatArray:
            _, largest = components_of(pairs.find(view), view.alive)
            return largest / view.per_robot_alive

        return measure


@dataclass(frozen=True)
class AggregationHop(OfClosePairs):
    """Robots alive in the largest flock / robots alive, 1/N to 1, with flocks of one hop; NaN if none is alive.

    For each robot alive that is in no flock yet, by rising index: open a flock with it and all robots alive that have
    less than `gap_m` between their surface and its own, by default a robot's diameter. To the letter, so one that is in
    a flock already is in this one, too; a flock is a star around the robot that opened it, not all who can be reached;
    and which robots open flocks depends on how they are numbered. `aggregation` depends on no numbers, and is never
    less: a chain of five is one cluster there, and flocks of two and three here.

    Source: Algorithm 1 of a study of flocking and search in the ARGoS simulator, which gives 100 times this and calls
    the threshold one robot dimension.
    """

    name = "aggregation_hop"
    help = "robots alive in the largest flock of one hop (Algorithm 1, gaps between surfaces) / robots alive"
    bounds = (0.0, 1.0)

    def begin(self, static: Static) -> Measure:
        """A fresh measure; what it remembers only makes it quick."""
        pairs = self.close_pairs(static)

        def measure(view: TickView) -> FloatArray:
            return largest_flock(pairs.find(view), view.alive) / view.per_robot_alive

        return measure


@njit()
def largest_flock(pairs: IntArray, alive: BoolArray) -> FloatArray:
    """The robots in the largest flock of each arena, (arenas,).

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
class AggregationTime(OfClosePairs):
    """First time in s from which the largest cluster held ceil(share N) of the N robots alive for `hold_s`.

    Clusters are those of `aggregation`, or with `reading = "hop"` the flocks of one hop of `aggregation_hop`. The time
    is that at which the held stretch began, 0 for a swarm that starts together; NaN until it has been held, the same
    from then on. Ticks without a robot alive end a stretch. With few robots shares are coarse: 0.8 asks for 4 of 5.

    Source: the time to a share of robots in one flock, as studies of aggregation report it; the hold time is ours.
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
        """A fresh measure."""
        largest_of = largest_flock if self.reading == "hop" else _largest_cluster
        pairs, hold_ns = self.close_pairs(static), to_ns(self.hold_s)
        since_ns: IntArray = np.full(static.arenas, NOT_YET, np.int64)
        found_s: FloatArray = np.full(static.arenas, np.nan)

        def measure(view: TickView) -> FloatArray:
            if np.isnan(found_s).any():
                largest = largest_of(pairs.find(view), view.alive)
                _follow(largest >= view.robots_for(self.share), view.truth.time_ns, hold_ns, since_ns, found_s)
            return found_s

        return measure


def _largest_cluster(pairs: IntArray, alive: BoolArray) -> IntArray:
    """The robots in the largest cluster of each arena, (arenas,)."""
    return components_of(pairs, alive)[1]


@njit()
def _follow(enough: AnyArray, now_ns: int, hold_ns: int, since_ns: AnyArray, found_s: AnyArray):
    """Note where a stretch begins and ends, and when the first began that lasted."""
    for arena in range(len(enough)):
        if not enough[arena]:
            since_ns[arena] = NOT_YET
        elif since_ns[arena] == NOT_YET:
            since_ns[arena] = now_ns
        if enough[arena] and np.isnan(found_s[arena]) and now_ns - since_ns[arena] >= hold_ns:
            found_s[arena] = since_ns[arena] / NS_PER_S
