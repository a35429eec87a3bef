"""ITU-R P.1238, site-general: indoor loss by kind of building, obstacles on the way included."""

import math
from dataclasses import dataclass

from swarmwire.comms.air.propagation.loss_curve import LossCurve, straight
from swarmwire.comms.parameters import parameter

# Kind of building: distance coefficient N; floor penetration in dB for one floor, and for each further one.
BUILDINGS = {"residential": (28.0, 4.0, 4.0), "office": (30.0, 15.0, 4.0), "commercial": (22.0, 6.0, 3.0)}


@dataclass(frozen=True)
class ItuIndoor:
    """L(d) = 20 log10 f + N log10 d + Lf(floors) - 28 dB, f in MHz, d > 1 m (ITU-R P.1238).

    N and Lf are those of the building at 1.8 to 2 GHz, as in ns-3, unless given; Lf(0) = 0.
    """

    building: str = parameter("office", help="where the robots are", choices=tuple(BUILDINGS))
    distance_coefficient_db: float | None = parameter(
        None, help="N, loss per decade of distance; without it, the building's", unit="dB", above=0, at_most=200
    )
    floors: int = parameter(0, help="floors between sender and receiver", at_least=0, at_most=100)

    def floor_loss_db(self) -> float:
        """Lf: what the floors on the way take, in dB."""
        _, first_db, further_db = BUILDINGS[self.building]
        return first_db + further_db * (self.floors - 1) if self.floors else 0.0

    def curve(self, frequency_hz: float) -> LossCurve:
        """The loss at this frequency."""
        given = self.distance_coefficient_db
        slope_db = BUILDINGS[self.building][0] if given is None else given
        return straight(20.0 * math.log10(frequency_hz / 1e6) + self.floor_loss_db() - 28.0, slope_db)
