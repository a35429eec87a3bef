"""Path loss and link budget: the loss of a signal over distance, in dB, and the received power.

Every model is a curve of straight lines over log10 of distance, from `config/path_loss_models.py`. So one compiled
function serves all models. Its inverse is exact, or by bisection in a medium that absorbs.

Distances are in space. Only two-ray also depends on the heights of the antennas, by `lifted`.

No model is valid in the near field of the antennas: below `NEAREST_M` the loss is that at `NEAREST_M`, as in ns-3's
log-distance model, so that no link amplifies.
"""

import math
from typing import Any, NamedTuple

from swarmwire.comms.base.kernels import njit
from swarmwire.comms.base.math import compiled as math_compiled
from swarmwire.comms.radio.config.path_loss_models import LossCurve
from swarmwire.comms.radio.propagation.obstruction import wall_loss_db
from swarmwire.comms.radio.propagation.shadowing import shadowing_db

NEAREST_M = 1.0
HALVINGS = 60


@njit()
def loss_db(curve: Any, distance_m: Any):
    """Return the path loss over a distance in m, in dB."""
    distance_m = max(distance_m, NEAREST_M)
    absorbed_db = curve.absorption_db_per_m * distance_m
    is_near = distance_m <= curve.break_m
    at_1_m_db = curve.near_db if is_near else curve.far_db
    slope_db = curve.near_slope_db if is_near else curve.far_slope_db
    return at_1_m_db + slope_db * math_compiled.log10(distance_m) + absorbed_db


@njit()
def lifted(curve: Any, a_m: Any, b_m: Any):
    """Return the loss curve between robots at the heights `a_m` and `b_m` in m: another one for two-ray alone.

    The heights of its antennas are then a + h1 and b + h2. Where h1 and h2 differ, their product is the mean of both
    directions, so that links stay equal both ways.
    """
    h1, h2 = curve.sender_height_m, curve.receiver_height_m
    if h1 == 0.0:
        return curve
    a_m, b_m = max(a_m, 0.0), max(b_m, 0.0)
    ratio = 0.5 * ((a_m + h1) * (b_m + h2) + (b_m + h1) * (a_m + h2)) / (h1 * h2)
    far_db = curve.far_db - 20.0 * math_compiled.log10(ratio)
    absorption_db_per_m = curve.absorption_db_per_m
    near = curve.near_db, curve.near_slope_db, curve.break_m * ratio
    return LossCurve(*near, far_db, curve.far_slope_db, absorption_db_per_m, h1, h2)


@njit()
def reach_m(curve: Any, max_loss_db: float):
    """Return the greatest distance in m with at most this loss, to 1e-12 relative; 0 if `NEAREST_M` has more."""
    if loss_db(curve, NEAREST_M) > max_loss_db:
        return 0.0
    lossless_reach_m = _reach_without_absorption_m(curve, max_loss_db)
    if curve.absorption_db_per_m == 0.0:
        return lossless_reach_m
    within_m, beyond_m = NEAREST_M, lossless_reach_m
    for _ in range(HALVINGS):
        middle_m = math.sqrt(within_m * beyond_m)
        if loss_db(curve, middle_m) <= max_loss_db:
            within_m = middle_m
        else:
            beyond_m = middle_m
    return within_m


@njit()
def _reach_without_absorption_m(curve: Any, max_loss_db: float):
    near_m = math_compiled.power(10.0, (max_loss_db - curve.near_db) / curve.near_slope_db)
    if near_m <= curve.break_m:
        return near_m
    far_m = math_compiled.power(10.0, (max_loss_db - curve.far_db) / curve.far_slope_db)
    return max(far_m, curve.break_m)


class MeanLoss(NamedTuple):
    """Parameters of the loss without bodies and fading, an input of kernels; 0 dB: the radio lacks that loss."""

    curve: LossCurve
    amplitude_db: float  # shadowing
    crossing_db: float  # walls
    inside_db_per_m: float  # walls


@njit()
def loss_between_db(
    mean_loss: Any,
    waves: Any,
    obstacles: Any,
    entered: Any,
    arena: int,
    distance_m: float,
    ax: float,
    ay: float,
    az: float,
    bx: float,
    by: float,
    bz: float,
):
    """Return the loss in dB between (ax, ay, az) and (bx, by, bz), `distance_m` apart in space; all in m.

    Path loss, shadowing and walls, without bodies and fading. `waves` (3, n) are those of the arena's field, walls are
    the arena's obstacles; `obstacles` and `entered` are those of `wall_loss_db`. The distance is a parameter, since the
    last bit of a run depends on its rounding. `phy/pairs.py` applies the same three steps to all pairs, but drops
    distant pairs after the first.
    """
    loss = loss_db(lifted(mean_loss.curve, az, bz), distance_m)
    if mean_loss.amplitude_db > 0.0:
        loss += shadowing_db(waves, mean_loss.amplitude_db, ax, ay, bx, by)
    crossing_db, inside_db_per_m = mean_loss.crossing_db, mean_loss.inside_db_per_m
    if crossing_db > 0.0 or inside_db_per_m > 0.0:
        loss += wall_loss_db(obstacles, entered, arena, crossing_db, inside_db_per_m, ax, ay, az, bx, by, bz)
    return loss


@njit()
def rssi_dbm(power_dbm: Any, sender_gain_dbi: Any, receiver_gain_dbi: Any, loss_db: Any):
    """Return the received power in dBm: power + gains - losses. Both directions differ only by the senders' powers."""
    return power_dbm + (sender_gain_dbi + receiver_gain_dbi) - loss_db
