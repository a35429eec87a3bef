"""Largest component: what share of the swarm still hangs together by radio."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure, Metric
from swarmwire.metrics.moment import Moment


@dataclass(frozen=True)
class LargestComponent(Metric):
    """Robots in the radio graph's largest component / robots alive: 1 when the swarm is in one piece.

    At least 1 / robots alive; NaN without a radio, or if no robot is alive.
    """

    name = "largest_component"
    help = "share of the robots alive that are in the radio graph's largest component"
    standard = True
    bounds = (0.0, 1.0)

    def begin(self, static: Static) -> Measure:
        """A fresh measure; nothing is remembered."""
        return _largest_component


def _largest_component(moment: Moment) -> FloatArray | float:
    found = moment.components
    return np.nan if found is None else found.largest / moment.per_robot_alive
