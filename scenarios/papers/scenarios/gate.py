"""A metric of one's own: how many robots pass a gate, and which way round."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.observe.truth import Static
from swarmwire.metrics.measures.metric import Measure, Metric, TickView


@dataclass(frozen=True)
class Gate(Metric):
    """Robots whose centre passed the y axis above the origin since the tick before: to the left less to the right.

    With an obstacle in the middle of an arena the half axis is a gate that whoever goes round must pass; counted
    anticlockwise, so that who goes to and fro counts for nothing. 0 in the first tick.
    """

    name = "gate"
    help = "robots that passed the gate above the origin anticlockwise less those that passed it clockwise"
    kind = "count"
    bounds = (-np.inf, None)

    def begin(self, static: Static) -> Measure:
        """A fresh measure, which keeps the places of the tick before."""
        before: FloatArray | None = None

        def measure(view: TickView) -> FloatArray:
            nonlocal before
            x, y = view.pose[:, :, 0], view.pose[:, :, 1]
            was = x if before is None else before
            before = x.copy()
            left = (was > 0.0) & (x <= 0.0) & (y > 0.0)
            right = (was <= 0.0) & (x > 0.0) & (y > 0.0)
            return view.sum_alive(left.astype(np.float64) - right)

        return measure
