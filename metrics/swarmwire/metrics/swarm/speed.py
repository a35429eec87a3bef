"""Speed: how fast the robots of a swarm move."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure, Metric
from swarmwire.metrics.moment import Moment


@dataclass(frozen=True)
class Speed(Metric):
    """Mean of |v_i| over the velocities v_i of the robots alive, in m/s; NaN if none is alive.

    Whichever way they go, and however they turn.
    """

    name = "speed"
    help = "mean speed of the robots alive, in m/s"
    unit = "m/s"
    bounds = (0.0, None)

    def begin(self, static: Static) -> Measure:
        """A fresh measure; nothing is remembered."""
        return _speed


def _speed(moment: Moment) -> FloatArray:
    velocity = moment.velocity
    return moment.sum_alive(np.hypot(velocity[:, :, 0], velocity[:, :, 1])) / moment.per_robot_alive
