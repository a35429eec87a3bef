"""The longest that a swarm that fell apart took to be whole again."""

from dataclasses import dataclass

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.truth import Static
from swarmwire.metrics.fragmentation import Fragmentation, OfFragmentation
from swarmwire.metrics.metric import Measure
from swarmwire.metrics.moment import Moment


@dataclass(frozen=True)
class RejoinWorst(OfFragmentation):
    """Longest time in s from falling apart to one component, over the fragmentation events re-joined so far.

    At least `hold_s`; its `final` is that of the run. Events that have not re-joined are left out: read it with
    `unrejoined`. NaN until the first has re-joined.
    """

    name = "rejoin_worst"
    help = "longest time to re-join over the fragmentations re-joined so far, in s"
    unit = "s"
    bounds = (0.0, None)

    def begin(self, static: Static) -> Measure:
        """A fresh measure."""
        events = Fragmentation(static, self.hold_s)

        def measure(moment: Moment) -> FloatArray:
            events.see(moment)
            return events.of_rejoined("max")

        return measure
