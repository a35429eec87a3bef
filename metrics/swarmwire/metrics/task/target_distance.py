"""Distances to the target, which is the nearest light: that of the best robot, and the swarm's mean."""

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure, Metric
from swarmwire.metrics.moment import Moment
from swarmwire.metrics.task.light_distance import light_distance


class _TargetDistance(Metric):
    """A statistic over the robots alive of the distance in m from a robot's centre to the nearest light of its arena.

    NaN without lights, or if no robot is alive.
    """

    unit = "m"
    standard = True
    bounds = (0.0, None)

    @abstractmethod
    def statistic(self, distance_m: FloatArray, moment: Moment) -> FloatArray:
        """Of the distances (arenas, robots), the dead's too, (arenas,); what is not finite where there is none."""

    def begin(self, static: Static) -> Measure:
        """A fresh measure; nothing is remembered."""
        distance_m = light_distance(static)

        def measure(moment: Moment) -> FloatArray | float:
            if distance_m is None:
                return np.nan
            value_m = self.statistic(distance_m(moment), moment)
            return np.where(np.isfinite(value_m), value_m, np.nan)

        return measure


@dataclass(frozen=True)
class TargetBest(_TargetDistance):
    """The least: 0 once a robot is at the target."""

    name = "target_best"
    help = "distance of the nearest robot alive to a light, in m"

    def statistic(self, distance_m: FloatArray, moment: Moment) -> FloatArray:
        """Of the robot that is nearest."""
        return np.min(distance_m, axis=1, where=moment.alive, initial=np.inf)


@dataclass(frozen=True)
class TargetMean(_TargetDistance):
    """The mean, which is at least `target_best`."""

    name = "target_mean"
    help = "mean distance of the robots alive to the light nearest to each, in m"

    def statistic(self, distance_m: FloatArray, moment: Moment) -> FloatArray:
        """Of all robots alive."""
        return moment.sum_alive(distance_m) / moment.per_robot_alive
