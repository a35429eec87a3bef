"""How long a swarm that fell apart takes to be whole again: usually, and at worst."""

from dataclasses import dataclass
from typing import ClassVar

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.truth import Static
from swarmwire.metrics.fragmentation import Fragmentation, OfFragmentation
from swarmwire.metrics.metric import Measure
from swarmwire.metrics.moment import Moment


class _Rejoin(OfFragmentation):
    """A statistic of the times in s from falling apart to one component, over the events re-joined so far.

    Each is at least `hold_s`; `final` is that of the run. Events that have not re-joined are left out, so a
    run that ends early looks quicker: read it with `unrejoined`. NaN until the first has re-joined.
    """

    unit = "s"
    bounds = (0.0, None)
    statistic: ClassVar[str]

    def begin(self, static: Static) -> Measure:
        """A fresh measure."""
        events = Fragmentation(static, self.hold_s)

        def measure(moment: Moment) -> FloatArray:
            events.see(moment)
            return events.of_rejoined(self.statistic)

        return measure


@dataclass(frozen=True)
class RejoinMedian(_Rejoin):
    """Median time to re-join."""

    name = "rejoin_median"
    help = "median time to re-join over the fragmentations re-joined so far, in s"
    statistic = "median"


@dataclass(frozen=True)
class RejoinWorst(_Rejoin):
    """Longest time to re-join."""

    name = "rejoin_worst"
    help = "longest time to re-join over the fragmentations re-joined so far, in s"
    statistic = "max"
