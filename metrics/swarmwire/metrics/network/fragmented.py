"""Fragmented: whether a swarm has fallen apart by radio right now."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure
from swarmwire.metrics.moment import Moment
from swarmwire.metrics.network.fragmentation import Fragmentation, OfFragmentation


@dataclass(frozen=True)
class Fragmented(OfFragmentation):
    """1 while a fragmentation event lasts, 0 else: its mean is the share of the time.

    What an event is, `metrics/network/fragmentation.py` says. It is 1 from the tick in which the event is counted, as
    nobody knows before that the split will last: the share of the time from falling apart to being whole again is this
    mean + `fragmentations` x `hold_s` / the run's length. NaN without a radio.
    """

    name = "fragmented"
    help = "1 while the radio graph has fallen apart for at least hold_s, 0 else"
    bounds = (0.0, 1.0)

    def begin(self, static: Static) -> Measure:
        """A fresh measure."""
        events = Fragmentation(static, self.hold_s)

        def measure(moment: Moment) -> FloatArray | float:
            if events.see(moment) is None:
                return np.nan
            return (events.started - events.rejoined).astype(np.float64)

        return measure
