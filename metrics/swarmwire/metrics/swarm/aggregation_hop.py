"""Aggregation within one hop: the largest flock as a published algorithm counts it."""

# pyright: basic, reportUnknownMemberType=false

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.kernels import njit
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure
from swarmwire.metrics.moment import Moment
from swarmwire.metrics.neighbours import neighbours_of
from swarmwire.metrics.swarm.close_pairs import OfClosePairs


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

        def measure(moment: Moment) -> FloatArray:
            return largest_flock(pairs.of(moment), moment.alive) / moment.per_robot_alive

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
