"""Order of velocities: how far the motion of a swarm goes one way."""

from dataclasses import dataclass

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure, Metric
from swarmwire.metrics.moment import Moment, agreement


@dataclass(frozen=True)
class OrderVelocity(Metric):
    """|sum v_i| / sum |v_i| over the velocities v_i of the robots alive; 0 if all stand still, NaN if none is alive.

    1 when all move one way, 0 when their motions cancel. Robots count by their speed, one that turns on the spot not at
    all, and one that drives backwards by where it goes; `order` counts each by where it looks.

    Source: the average normalised velocity of T. Vicsek et al., PRL 75 (1995), with speeds that differ.
    """

    name = "order_velocity"
    help = "order of velocities: |sum of velocities| / sum of speeds, over robots alive"
    standard = True
    bounds = (0.0, 1.0)

    def begin(self, static: Static) -> Measure:
        """A fresh measure; nothing is remembered."""
        return _order_velocity


def _order_velocity(moment: Moment) -> FloatArray:
    return agreement(moment.velocity[:, :, 0], moment.velocity[:, :, 1], moment.alive, True)
