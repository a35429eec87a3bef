"""Two-ray ground: the direct ray and the one that the ground reflects cancel each other far away."""

import math
from dataclasses import dataclass

from swarmwire.comms.air.propagation.friis import loss_at_1_m_db
from swarmwire.comms.air.propagation.loss_curve import SPEED_OF_LIGHT_MPS, LossCurve
from swarmwire.comms.parameters import parameter


@dataclass(frozen=True)
class TwoRay:
    """Friis up to the crossover d = 4 pi h1 h2 f / c, beyond it L(d) = 40 log10 d - 20 log10(h1 h2) dB, d and h in m.

    As in ns-2 and ns-3 (T. S. Rappaport, Wireless Communications, 1996). Both lines meet at the crossover, which
    is near: 4 m for two antennas 0.2 m above the ground at 2.4 GHz.
    """

    sender_height_m: float = parameter(
        1.5, help="height of the sender's antenna above the ground", unit="m", above=0, at_most=1000
    )
    receiver_height_m: float = parameter(
        1.5, help="height of the receiver's antenna above the ground", unit="m", above=0, at_most=1000
    )

    def crossover_m(self, frequency_hz: float) -> float:
        """Where the ground begins to count, in m."""
        return 4.0 * math.pi * self.sender_height_m * self.receiver_height_m * frequency_hz / SPEED_OF_LIGHT_MPS

    def curve(self, frequency_hz: float) -> LossCurve:
        """The loss at this frequency."""
        ground_db = -20.0 * math.log10(self.sender_height_m * self.receiver_height_m)
        return LossCurve(loss_at_1_m_db(frequency_hz), 20.0, self.crossover_m(frequency_hz), ground_db, 40.0)
