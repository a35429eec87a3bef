"""Loss curves: straight lines over log10 of distance, the form that all models of path loss share."""

import math
from typing import NamedTuple

SPEED_OF_LIGHT_MPS = 299_792_458.0


class LossCurve(NamedTuple):
    """L(d) = near_db + near_slope_db log10 d up to `break_m`, far_db + far_slope_db log10 d beyond; d in m.

    On top comes absorption_db_per_m x d. Slopes are positive and the curve does not fall at the break.
    """

    near_db: float
    near_slope_db: float  # per decade of distance
    break_m: float
    far_db: float
    far_slope_db: float  # per decade of distance
    absorption_db_per_m: float = 0.0


def straight(loss_db_at_1_m: float, slope_db: float, absorption_db_per_m: float = 0.0) -> LossCurve:
    """A curve that is one straight line, with a slope in dB per decade of distance, but for what is absorbed."""
    return LossCurve(loss_db_at_1_m, slope_db, math.inf, loss_db_at_1_m, slope_db, absorption_db_per_m)
