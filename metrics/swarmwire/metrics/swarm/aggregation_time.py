"""The aggregation time: when most of a swarm had come together."""

# pyright: basic, reportUnknownMemberType=false

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.clock import NS_PER_S, to_ns
from swarmwire.comms.config import parameter
from swarmwire.comms.kernels import njit
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure
from swarmwire.metrics.moment import Moment, components_of
from swarmwire.metrics.swarm.aggregation_hop import largest_flock
from swarmwire.metrics.swarm.close_pairs import OfClosePairs

NOT_YET = -1


@dataclass(frozen=True)
class AggregationTime(OfClosePairs):
    """First time in s from which the largest cluster held ceil(share N) of the N robots alive for `hold_s`.

    Clusters are those of `aggregation`, or with `reading = "hop"` the flocks of one hop of `aggregation_hop`. The time
    is that at which the held stretch began, 0 for a swarm that starts together; NaN until it has been held, the same
    from then on. Ticks without a robot alive end a stretch. With few robots shares are coarse: 0.8 asks for 4 of 5.

    Source: the time to a share of robots in one flock, as studies of aggregation report it; the hold time is ours.
    """

    share: float = parameter(0.8, help="of the robots alive, in the largest cluster", above=0.0, at_most=1.0)
    reading: str = parameter(
        "cluster",
        choices=("cluster", "hop"),
        help="who is together: all who can be reached by steps of less than the gap, or within one step of one robot",
    )
    hold_s: float = parameter(0.0, help="for how long", unit="s", at_least=0.0)

    name = "aggregation_time_s"
    help = "start of the first stretch in which the largest cluster held a share of the robots alive for long, in s"
    unit = "s"
    kind = "time"
    bounds = (0.0, None)

    def begin(self, static: Static) -> Measure:
        """A fresh measure."""
        largest_of = largest_flock if self.reading == "hop" else _largest_cluster
        pairs, hold_ns = self.close_pairs(static), to_ns(self.hold_s)
        since_ns: IntArray = np.full(static.arenas, NOT_YET, np.int64)
        found_s: FloatArray = np.full(static.arenas, np.nan)

        def measure(moment: Moment) -> FloatArray:
            if np.isnan(found_s).any():
                largest = largest_of(pairs.of(moment), moment.alive)
                _follow(largest >= moment.robots_for(self.share), moment.truth.time_ns, hold_ns, since_ns, found_s)
            return found_s

        return measure


def _largest_cluster(pairs: IntArray, alive: BoolArray) -> IntArray:
    """The robots in the largest cluster of each arena, (arenas,)."""
    return components_of(pairs, alive)[1]


@njit()
def _follow(enough, now_ns, hold_ns, since_ns, found_s):
    """Note where a stretch begins and ends, and when the first began that lasted."""
    for arena in range(len(enough)):
        if not enough[arena]:
            since_ns[arena] = NOT_YET
        elif since_ns[arena] == NOT_YET:
            since_ns[arena] = now_ns
        if enough[arena] and np.isnan(found_s[arena]) and now_ns - since_ns[arena] >= hold_ns:
            found_s[arena] = since_ns[arena] / NS_PER_S
