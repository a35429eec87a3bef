"""Order: how far the headings of a swarm agree."""

from dataclasses import dataclass

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure, Metric
from swarmwire.metrics.moment import Moment, agreement


@dataclass(frozen=True)
class Order(Metric):
    """|sum u_i| / N over the unit headings u_i of the N robots alive; NaN if none is.

    1 when all point one way, 0 when they cancel. Of headings at random its mean is near sqrt(pi / (4 N)) and the mean
    of its square is 1/N: small swarms look ordered by chance. It differs from |sum v_i| / sum |v_i|, which weights
    robots by speed and turns those around that drive backwards.

    Source: T. Vicsek et al., Novel type of phase transition in a system of self-driven particles, PRL 75 (1995), eq. 3,
    with headings for directions of motion.
    """

    name = "order"
    help = "order of headings: |sum of unit headings| / robots alive"
    standard = True
    bounds = (0.0, 1.0)

    def begin(self, static: Static) -> Measure:
        """A fresh measure; nothing is remembered."""
        return _order


def _order(moment: Moment) -> FloatArray:
    return agreement(*moment.direction, moment.alive, False)
