"""Metrics that cost more than every tick is worth: measured every so often, their value held in between."""

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.clock import to_ns
from swarmwire.comms.config import parameter
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure, Metric
from swarmwire.metrics.moment import Moment


@dataclass(frozen=True)
class Sampled(Metric):
    """A metric that is measured at the start, then in the first tick at or after each multiple of `every_s`.

    In between it has the value of the last sample, whoever has died since; 0 samples every tick.
    """

    every_s: float = parameter(1.0, help="from one sample to the next; 0: every tick", unit="s", at_least=0.0)

    @abstractmethod
    def sample(self, static: Static) -> Measure:
        """A fresh measure for a run; it is called for the ticks that are sampled, in order."""

    def begin(self, static: Static) -> Measure:
        """A fresh measure, which holds what was sampled last."""
        sample, every_ns = self.sample(static), max(to_ns(self.every_s), 1)
        held: FloatArray | float = np.nan
        next_ns = 0

        def measure(moment: Moment) -> FloatArray | float:
            nonlocal held, next_ns
            now_ns = moment.truth.time_ns
            if now_ns >= next_ns:
                held, next_ns = sample(moment), (now_ns // every_ns + 1) * every_ns
            return held

        return measure
