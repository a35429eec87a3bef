"""Path loss models as scenario tables, and their common loss curve: straight lines over log10 of distance."""

import math
from dataclasses import dataclass
from typing import NamedTuple

from swarmwire.comms.base import math as portable
from swarmwire.comms.base.config import parameter

SPEED_OF_LIGHT_MPS = 299_792_458.0


class LossCurve(NamedTuple):
    """L(d) = near_db + near_slope_db log10 d up to `break_m`, far_db + far_slope_db log10 d beyond; d in m.

    absorption_db_per_m x d is added. Slopes are positive, and the curve does not fall at the break.
    """

    near_db: float
    near_slope_db: float  # per decade of distance
    break_m: float
    far_db: float
    far_slope_db: float  # per decade of distance
    absorption_db_per_m: float = 0.0
    sender_height_m: float = 0.0  # of two-ray, for robots at height 0; 0: the model does not depend on heights
    receiver_height_m: float = 0.0


def straight(loss_db_at_1_m: float, slope_db: float, absorption_db_per_m: float = 0.0) -> LossCurve:
    """Return a curve of one straight line, with a slope in dB per decade of distance, plus absorption."""
    return LossCurve(loss_db_at_1_m, slope_db, math.inf, loss_db_at_1_m, slope_db, absorption_db_per_m)


def loss_at_1_m_db(frequency_hz: float) -> float:
    """Free-space loss over 1 m, in dB: 20 log10(4 pi f / c)."""
    return 20.0 * portable.log10(4.0 * math.pi * frequency_hz / SPEED_OF_LIGHT_MPS)


@dataclass(frozen=True)
class Friis:
    """L(d) = 20 log10(4 pi d f / c) dB (H. T. Friis, Proc. IRE 34, 1946), antenna gains apart."""

    def curve(self, frequency_hz: float) -> LossCurve:
        """Return the loss at this frequency."""
        return straight(loss_at_1_m_db(frequency_hz), 20.0)


@dataclass(frozen=True)
class LogDistance:
    """L(d) = L(1 m) + 10 n log10 d + a d dB (T. S. Rappaport, Wireless Communications, 1996; a: absorption)."""

    exponent: float = parameter(
        3.0, help="the exponent n: 2 in free space, 1.6 to 3.5 indoors, 3 to 5 in cities", above=0, at_most=20
    )
    reference_loss_db: float | None = parameter(
        None, help="loss at 1 m; default: that of free space at the radio's frequency", unit="dB"
    )
    absorption_db_per_m: float = parameter(
        0.0, help="the absorption a per metre, as of water or leaves", unit="dB/m", at_least=0, at_most=1000
    )

    def curve(self, frequency_hz: float) -> LossCurve:
        """Return the loss at this frequency, which has no effect if the reference loss is set."""
        reference_db = loss_at_1_m_db(frequency_hz) if self.reference_loss_db is None else self.reference_loss_db
        return straight(reference_db, 10.0 * self.exponent, self.absorption_db_per_m)


@dataclass(frozen=True)
class TwoRay:
    """Friis up to the crossover d = 4 pi h1 h2 f / c, beyond it L(d) = 40 log10 d - 20 log10(h1 h2) dB, d and h in m.

    The model of ns-2 and ns-3 (T. S. Rappaport, Wireless Communications, 1996). Both lines meet at the crossover, which
    is near: 4 m for antennas 0.2 m above the ground at 2.4 GHz. The height of a robot above the floor is added to that
    of its antenna.
    """

    sender_height_m: float = parameter(
        1.5,
        help="height of the sender's antenna above its robot's lower side",
        unit="m",
        above=0,
        at_most=1000,
    )
    receiver_height_m: float = parameter(
        1.5,
        help="height of the receiver's antenna above its robot's lower side",
        unit="m",
        above=0,
        at_most=1000,
    )

    def crossover_m(self, frequency_hz: float) -> float:
        """Distance beyond which the ground reflection counts, in m."""
        return 4.0 * math.pi * self.sender_height_m * self.receiver_height_m * frequency_hz / SPEED_OF_LIGHT_MPS

    def curve(self, frequency_hz: float) -> LossCurve:
        """Return the loss at this frequency."""
        h1, h2 = self.sender_height_m, self.receiver_height_m
        ground_db = -20.0 * portable.log10(h1 * h2)
        return LossCurve(
            loss_at_1_m_db(frequency_hz), 20.0, self.crossover_m(frequency_hz), ground_db, 40.0, 0.0, h1, h2
        )


# Kind of building: distance coefficient N; floor penetration in dB for one floor, and for each further one.
BUILDINGS = {"residential": (28.0, 4.0, 4.0), "office": (30.0, 15.0, 4.0), "commercial": (22.0, 6.0, 3.0)}


@dataclass(frozen=True)
class ItuIndoor:
    """L(d) = 20 log10 f + N log10 d + Lf(floors) - 28 dB, f in MHz, d > 1 m (ITU-R P.1238).

    Defaults of N and Lf are those of the building at 1.8 to 2 GHz, as in ns-3; Lf(0) = 0.
    """

    building: str = parameter("office", help="kind of building", choices=tuple(BUILDINGS))
    distance_coefficient_db: float | None = parameter(
        None, help="N, loss per decade of distance; default: the building's", unit="dB", above=0, at_most=200
    )
    floors: int = parameter(0, help="floors between sender and receiver", at_least=0, at_most=100)

    def floor_loss_db(self) -> float:
        """Lf: loss in the floors, in dB."""
        _, first_db, further_db = BUILDINGS[self.building]
        return first_db + further_db * (self.floors - 1) if self.floors else 0.0

    def curve(self, frequency_hz: float) -> LossCurve:
        """Return the loss at this frequency."""
        slope_db = self.distance_coefficient_db
        if slope_db is None:
            slope_db = BUILDINGS[self.building][0]
        return straight(20.0 * portable.log10(frequency_hz / 1e6) + self.floor_loss_db() - 28.0, slope_db)
