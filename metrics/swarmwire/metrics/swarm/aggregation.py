"""Aggregation: the share of the swarm in its largest cluster."""

from dataclasses import dataclass

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure
from swarmwire.metrics.moment import Moment, components_of
from swarmwire.metrics.swarm.close_pairs import OfClosePairs


@dataclass(frozen=True)
class Aggregation(OfClosePairs):
    """Robots alive in the largest cluster / robots alive, 1/N to 1; NaN if none is alive.

    A cluster is a connected component of the graph that joins two robots alive with less than `gap_m` from surface to
    surface, by default a robot's diameter: whoever can be reached by such steps belongs to it, so a chain is one
    cluster. `aggregation_hop` takes one step only. Of mixed bodies the default gap of a pair is the mean of both
    diameters, so that at most touching robots of their size fit between.

    Source: the largest cluster of M. Gauci et al., IJRR 33 (2014), with the gap of `aggregation_hop`.
    """

    name = "aggregation"
    help = "robots alive in the largest cluster (steps of less than a gap between surfaces) / robots alive"
    bounds = (0.0, 1.0)

    def begin(self, static: Static) -> Measure:
        """A fresh measure; what it remembers only makes it quick."""
        pairs = self.close_pairs(static)

        def measure(moment: Moment) -> FloatArray:
            _, largest = components_of(pairs.of(moment), moment.alive)
            return largest / moment.per_robot_alive

        return measure
