"""A metric of one's own: how many of the robots seal the leak."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.observe.truth import Static
from swarmwire.metrics.measures.metric import Measure, Metric, TickView


@dataclass(frozen=True)
class Sealing(Metric):
    """By what robots say that they are at."""

    name = "sealing"
    help = "share of the robots alive that seal the leak"
    bounds = (0.0, 1.0)

    def begin(self, static: Static) -> Measure:
        def measure(view: TickView):
            states, state = view.truth.states, view.truth.state.reshape(view.alive.shape)
            sealing = state == states.index("sealing") if "sealing" in states else state < 0
            return view.sum_alive(sealing.astype(np.float64)) / view.per_robot_alive

        return measure
