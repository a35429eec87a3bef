"""Path loss and link budget: the loss of a signal over distance, in dB, and the received power.

Every model is a curve of straight lines over log10 of distance. So one compiled function serves all models, and its
inverse is exact, or found by bisection where the medium absorbs. The models are the frozen dataclasses with a method
`curve(frequency_hz)` in `config/path_loss_models.py`.

No model holds in the near field of the antennas: below `NEAREST_M` the loss is that at `NEAREST_M`, as in ns-3's
log-distance model, so that touching robots do not amplify each other.
"""

# pyright: basic, reportUnknownMemberType=false

import math

from swarmwire.comms.base.kernels import njit
from swarmwire.comms.radio.propagation.obstruction import wall_loss_db
from swarmwire.comms.radio.propagation.shadowing import shadowing_db

NEAREST_M = 1.0
HALVINGS = 60


@njit()
def loss_db(curve, distance_m):
    """Path loss in dB over a distance in m."""
    distance_m = max(distance_m, NEAREST_M)
    absorbed_db = curve.absorption_db_per_m * distance_m
    if distance_m <= curve.break_m:
        return curve.near_db + curve.near_slope_db * math.log10(distance_m) + absorbed_db
    return curve.far_db + curve.far_slope_db * math.log10(distance_m) + absorbed_db


@njit()
def reach_m(curve, most_loss_db):
    """The greatest distance in m with at most this loss, to 1e-12 relative; 0 if `NEAREST_M` has more."""
    if loss_db(curve, NEAREST_M) > most_loss_db:
        return 0.0
    reached_m = _reach_of_lines_m(curve, most_loss_db)
    if curve.absorption_db_per_m == 0.0:
        return reached_m
    within_m, beyond_m = NEAREST_M, reached_m
    for _ in range(HALVINGS):
        middle_m = math.sqrt(within_m * beyond_m)
        if loss_db(curve, middle_m) <= most_loss_db:
            within_m = middle_m
        else:
            beyond_m = middle_m
    return within_m


@njit()
def _reach_of_lines_m(curve, most_loss_db):
    near_m = 10.0 ** ((most_loss_db - curve.near_db) / curve.near_slope_db)
    if near_m <= curve.break_m:
        return near_m
    far_m = 10.0 ** ((most_loss_db - curve.far_db) / curve.far_slope_db)
    return max(far_m, curve.break_m)


@njit()
def loss_between_db(
    curve, waves, amplitude_db, obstacles, entered, arena, crossing_db, inside_db_per_m, distance_m, ax, ay, bx, by
):
    """The loss in dB between (ax, ay) and (bx, by), `distance_m` apart; all in m.

    Path loss, shadowing and walls, without bodies and fading. `waves` (3, n) are those of the arena's field; an
    `amplitude_db` of 0 means no shadowing. Walls are the arena's obstacles; `crossing_db` and `inside_db_per_m` of 0
    mean none. `obstacles` and `entered` are as in `wall_loss_db`. Callers pass the distance, since the last bit of a
    run depends on its rounding. `phy/pairs.py` applies the same three steps over all pairs, since it drops distant
    pairs after the first.
    """
    loss = loss_db(curve, distance_m)
    if amplitude_db > 0.0:
        loss += shadowing_db(waves, amplitude_db, ax, ay, bx, by)
    if crossing_db > 0.0 or inside_db_per_m > 0.0:
        loss += wall_loss_db(obstacles, entered, arena, crossing_db, inside_db_per_m, ax, ay, bx, by)
    return loss


@njit()
def rssi_dbm(power_dbm, sender_gain_dbi, receiver_gain_dbi, loss_db):
    """Received power in dBm: power + both gains - all losses. Reciprocal up to the difference in power."""
    return power_dbm + (sender_gain_dbi + receiver_gain_dbi) - loss_db
