"""A metric: whether a swarm is one flock, by the worse of how far it is aligned and how far it is together."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.observe.truth import Static
from swarmwire.metrics.measures.metric import Measure, TickView
from swarmwire.metrics.measures.swarm.aggregation import AggregationRatio
from swarmwire.metrics.measures.swarm.order import Order


@dataclass(frozen=True)
class Flock(AggregationRatio):
    """The smaller of `order` and `aggregation`, 0 to 1: both are at least as high; NaN if none is alive.

    A swarm whose robots go their ways is no flock though they are parallel, nor is a heap whose robots point anywhere.
    """

    name = "flock"
    help = "the smaller of the order of headings and the share of robots alive in the largest cluster"

    def begin(self, static: Static) -> Measure:
        """A fresh measure."""
        aligned, together = Order().begin(static), super().begin(static)

        def measure(view: TickView) -> FloatArray:
            return np.minimum(aligned(view), together(view))

        return measure
