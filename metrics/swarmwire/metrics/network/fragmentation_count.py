"""How often a swarm fell apart by radio."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure
from swarmwire.metrics.moment import Moment
from swarmwire.metrics.network.fragmentation import Fragmentation, OfFragmentation


@dataclass(frozen=True)
class Fragmentations(OfFragmentation):
    """Times that the radio graph's components rose above 1 and stayed there for at least `hold_s`.

    Counted at the end of that hold; what an event is, `metrics/network/fragmentation.py` says. NaN without a radio.
    """

    name = "fragmentations"
    help = "times that the radio graph fell apart for at least hold_s"
    kind = "count"
    standard = True
    bounds = (0.0, None)

    def begin(self, static: Static) -> Measure:
        """A fresh measure."""
        events = Fragmentation(static, self.hold_s)

        def measure(moment: Moment) -> FloatArray | float:
            counted = events.see(moment)
            return np.nan if counted is None else counted.astype(np.float64)

        return measure
