"""The share of fragmentations that a swarm has not got over."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure
from swarmwire.metrics.moment import Moment
from swarmwire.metrics.network.fragmentation import Fragmentation, OfFragmentation


@dataclass(frozen=True)
class Unrejoined(OfFragmentation):
    """Fragmentation events that have not re-joined / events so far: its `final` is the share censored by the end.

    An arena has at most one that is open. NaN before the first event.
    """

    name = "unrejoined"
    help = "share of the fragmentations so far that have not re-joined"
    standard = True
    bounds = (0.0, 1.0)

    def begin(self, static: Static) -> Measure:
        """A fresh measure."""
        events = Fragmentation(static, self.hold_s)

        def measure(moment: Moment) -> FloatArray | float:
            if events.see(moment) is None:
                return np.nan
            return (events.started - events.rejoined) / np.where(events.started > 0, events.started, np.nan)

        return measure
