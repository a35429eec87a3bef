"""The swarm's mean distance to the target: the nearest light."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure, Metric
from swarmwire.metrics.moment import Moment
from swarmwire.metrics.task.light_distance import light_distance


@dataclass(frozen=True)
class TargetMean(Metric):
    """Mean over the robots alive of the distance in m from centre to nearest light of the arena.

    At least `target_best`; NaN without lights, or if no robot is alive.
    """

    name = "target_mean"
    help = "mean distance of the robots alive to the light nearest to each, in m"
    unit = "m"
    standard = True
    bounds = (0.0, None)

    def begin(self, static: Static) -> Measure:
        """A fresh measure; nothing is remembered."""
        distance_m = light_distance(static)

        def measure(moment: Moment) -> FloatArray | float:
            if distance_m is None:
                return np.nan
            sum_m = moment.sum_alive(distance_m(moment))
            return np.where(np.isfinite(sum_m), sum_m, np.nan) / moment.per_robot_alive

        return measure
