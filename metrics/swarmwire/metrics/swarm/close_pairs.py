"""Who is close to whom: pairs of robots with little room between their surfaces, of which aggregates are made."""

from dataclasses import dataclass

from swarmwire.comms.config import parameter
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Metric
from swarmwire.metrics.swarm.near_pairs import NearPairs
from swarmwire.metrics.swarm.radii import radii_m


@dataclass(frozen=True)
class OfClosePairs(Metric):
    """A metric of the robots alive between whose surfaces there are less than `gap_m`, as seen from above.

    The gap of two robots is |x_i - x_j| - r_i - r_j, the shortest way on a torus, whatever their heights: from surface
    to surface, since the centres of two discs that touch are a diameter apart already.
    """

    gap_m: float | None = parameter(
        None,
        help="robots with less between their surfaces are together; left out: the diameter of one, or the mean of both",
        unit="m",
        above=0.0,
    )

    def close_pairs(self, static: Static) -> NearPairs:
        """A finder of those pairs."""
        radius_m = radii_m(static)
        return NearPairs(static, 2.0 * radius_m if self.gap_m is None else radius_m + 0.5 * self.gap_m)
