"""Metrics of the experiment on minimalist flocking: who is near a wall, and how fast flocks of a size move."""

# pyright: basic, reportUnknownMemberType=false

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numba import njit

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.config import parameter
from swarmwire.comms.observe.truth import Static
from swarmwire.metrics.measures.metric import Measure, Metric, TickView
from swarmwire.metrics.measures.swarm.aggregation import ClosePairsMetric
from swarmwire.metrics.measures.swarm.pairs import radii_m


@dataclass(frozen=True)
class NearWall(Metric):
    """Robots alive with less than `gap_m` between their rim and the nearest wall of the arena / robots alive."""

    gap_m: float = parameter(0.07, help="rim to wall", unit="m", above=0.0)

    name = "near_wall"
    help = "robots alive within a gap of a wall / robots alive"
    bounds = (0.0, 1.0)

    def begin(self, static: Static) -> Measure:
        """A measure of a walled arena."""
        half_m = 0.5 * np.array(static.arena_size_m)
        reach_m = radii_m(static) + self.gap_m

        def measure(view: TickView) -> FloatArray:
            to_wall_m = np.min(half_m - np.abs(view.position_m), axis=2)
            return view.sum_alive((to_wall_m < reach_m).astype(np.float64)) / view.per_robot_alive

        return measure


@dataclass(frozen=True)
class FlockSpeed(ClosePairsMetric):
    """Mean speed of the centroids of the clusters that have `least` to `most` robots, in m/s; NaN if there is none.

    Clusters are those of `aggregation`; a centroid's velocity is the mean of its robots'.
    """

    least: ClassVar[int] = 1
    most: ClassVar[int] = 1

    name = "flock_speed_1"
    help = "mean speed of the centroids of clusters of a size, in m/s"
    unit = "m/s"
    bounds = (0.0, None)

    def begin(self, static: Static) -> Measure:
        """A fresh measure."""
        pairs, least, most = self.close_pairs(static), self.least, self.most

        def measure(view: TickView) -> FloatArray:
            return _speed_mps(pairs.find(view), view.velocity, view.alive, least, most)

        return measure


class FlockSpeed2(FlockSpeed):
    """Of two."""

    least, most, name = 2, 2, "flock_speed_2"


class FlockSpeed3(FlockSpeed):
    """Of three."""

    least, most, name = 3, 3, "flock_speed_3"


class FlockSpeed4(FlockSpeed):
    """Of four and more."""

    least, most, name = 4, 1_000_000, "flock_speed_4_up"


@njit()
def _speed_mps(pairs, velocity, alive, least, most):
    """The mean speed of the centroids of each arena, (arenas,)."""
    arenas, robots = alive.shape
    label = np.arange(arenas * robots)
    for _ in range(robots):  # the lowest row of a cluster spreads by a pair a pass, and mostly much faster
        changed = False
        for k in range(len(pairs)):
            low = min(label[pairs[k, 0]], label[pairs[k, 1]])
            changed = changed or label[pairs[k, 0]] != low or label[pairs[k, 1]] != low
            label[pairs[k, 0]], label[pairs[k, 1]] = low, low
        if not changed:
            break
    means = np.full(arenas, np.nan)
    for arena in range(arenas):
        size, sums = np.zeros(robots), np.zeros((robots, 2))
        for i in range(robots):
            if alive[arena, i]:
                robot = label[arena * robots + i] - arena * robots
                size[robot] += 1
                sums[robot] += velocity[arena, i, :2]
        total, clusters = 0.0, 0
        for robot in range(robots):
            if least <= size[robot] <= most:
                total += np.hypot(sums[robot, 0], sums[robot, 1]) / size[robot]
                clusters += 1
        if clusters:
            means[arena] = total / clusters
    return means
