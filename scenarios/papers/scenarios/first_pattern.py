"""A metric of one's own: what is left of the disagreement with which a consensus began."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.observe.truth import Static
from swarmwire.metrics.measures.metric import Measure, Metric, TickView


@dataclass(frozen=True)
class FirstPattern(Metric):
    """<x - mean x, d> / <d, d>, with d the robots' first values x less their mean: 1 at first, 0 once it is gone.

    x_i is what robot i told last (`note(value=...)`). It is linear in x, so its mean over runs that begin alike follows
    the mean of x; where d is an eigenvector of the mean step, that mean decays by the eigenvalue in each step, exactly.
    Values of all robots are needed; NaN before they are told, and if all begin with the same.
    """

    name = "first_pattern"
    help = "share of the first values' pattern that is left in the values that robots told last"
    bounds = (-np.inf, None)

    def begin(self, static: Static) -> Measure:
        """A fresh measure, which keeps the first values."""
        first: FloatArray = np.full((static.arenas, static.robots), np.nan)

        def measure(view: TickView) -> FloatArray | float:
            if view.truth.value is None:
                return np.nan
            value = view.truth.value.reshape(first.shape)
            np.copyto(first, value, where=np.isnan(first))
            pattern = first - first.mean(axis=1, keepdims=True)
            square = (pattern * pattern).sum(axis=1)
            return (value * pattern).sum(axis=1) / np.where(square > 0.0, square, np.nan)

        return measure
