"""The best robot's distance to the target: the nearest light."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure, Metric
from swarmwire.metrics.moment import Moment
from swarmwire.metrics.task.light_distance import light_distance


@dataclass(frozen=True)
class TargetBest(Metric):
    """min over the robots alive of the distance in m from centre to nearest light of the arena: 0 at the target.

    NaN without lights, or if no robot is alive.
    """

    name = "target_best"
    help = "distance of the nearest robot alive to a light, in m"
    unit = "m"
    standard = True
    bounds = (0.0, None)

    def begin(self, static: Static) -> Measure:
        """A fresh measure; nothing is remembered."""
        distance_m = light_distance(static)

        def measure(moment: Moment) -> FloatArray | float:
            if distance_m is None:
                return np.nan
            best_m = np.min(distance_m(moment), axis=1, where=moment.alive, initial=np.inf)
            return np.where(np.isfinite(best_m), best_m, np.nan)

        return measure
