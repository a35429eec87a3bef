"""Find time: when the first robot, or a share of them, was at the target, the nearest light."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.clock import to_s
from swarmwire.comms.config import parameter
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure, Metric
from swarmwire.metrics.moment import Moment
from swarmwire.metrics.task.light_distance import light_distance


@dataclass(frozen=True)
class FindTime(Metric):
    """First time in s at which ceil(`share` x N) of the N robots alive, at least one, are within `within_m` of a light.

    Of their centres, each to the light nearest to it. 0 if they stand there at the start. It stays, whatever becomes of
    the robots. NaN until then, and without lights.
    """

    name = "find_time_s"
    help = "first time that a share of the robots alive, at least one, is within within_m of a light, in s"
    unit = "s"
    kind = "time"
    bounds = (0.0, None)

    within_m: float = parameter(0.5, help="who is no further from a light has found it", unit="m", at_least=0.0)
    share: float = parameter(0.0, help="of the robots alive, that must be there at once", at_least=0.0, at_most=1.0)

    def begin(self, static: Static) -> Measure:
        """A fresh measure, which keeps when it happened."""
        distance_m = light_distance(static)
        found_s: FloatArray = np.full(static.arenas, np.nan)

        def measure(moment: Moment) -> FloatArray:
            open_ = np.isnan(found_s)
            if distance_m is not None and open_.any():
                there = np.sum(distance_m(moment) <= self.within_m, axis=1, where=moment.alive)
                found_s[open_ & (there >= moment.robots_for(self.share))] = to_s(moment.truth.time_ns)
            return found_s

        return measure
