"""How long a swarm that fell apart takes to be whole again: usually, and at worst."""

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure
from swarmwire.metrics.moment import Moment
from swarmwire.metrics.network.fragmentation import Fragmentation, OfFragmentation


class _Rejoin(OfFragmentation):
    """A statistic of the times in s from falling apart to one component, over the events re-joined so far.

    Each is at least `hold_s`; `final` is that of the run. Events that have not re-joined are left out, so a
    run that ends early looks quicker: read it with `unrejoined`. NaN until the first has re-joined.
    """

    unit = "s"
    bounds = (0.0, None)

    @abstractmethod
    def statistic(self, lengths_s: list[float]) -> float:
        """The statistic of the lengths of the events that are over: at least one."""

    def begin(self, static: Static) -> Measure:
        """A fresh measure."""
        events = Fragmentation(static, self.hold_s)
        found_s: FloatArray = np.full(static.arenas, np.nan)

        def measure(moment: Moment) -> FloatArray:
            events.see(moment)
            for arena in events.rejoined_now:
                found_s[arena] = self.statistic(events.rejoined_s[arena])
            return found_s

        return measure


@dataclass(frozen=True)
class RejoinMedian(_Rejoin):
    """Median time to re-join."""

    name = "rejoin_median"
    help = "median time to re-join over the fragmentations re-joined so far, in s"
    standard = True

    def statistic(self, lengths_s: list[float]) -> float:
        """The middle one, or the mean of the two in the middle."""
        return float(np.median(lengths_s))


@dataclass(frozen=True)
class RejoinWorst(_Rejoin):
    """Longest time to re-join."""

    name = "rejoin_worst"
    help = "longest time to re-join over the fragmentations re-joined so far, in s"
    standard = True

    def statistic(self, lengths_s: list[float]) -> float:
        """The longest."""
        return max(lengths_s)
