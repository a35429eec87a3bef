"""The loss between two points: path loss, shadowing and walls together, without bodies and fading.

The table of links takes the same three in stages over all pairs, since it leaves out who is too far before it goes on.
"""

# pyright: basic, reportUnknownMemberType=false

from numba import njit

from swarmwire.comms.air.propagation.path_loss import loss_db
from swarmwire.comms.air.propagation.shadowing import shadowing_db
from swarmwire.comms.air.propagation.walls import wall_loss_db


@njit(cache=True)
def loss_between_db(
    curve, waves, amplitude_db, obstacles, arena, crossing_db, inside_db_per_m, distance_m, ax, ay, bx, by
):
    """The loss in dB between (ax, ay) and (bx, by), `distance_m` apart; all in m.

    `waves` (3, n) are those of the arena's field; an `amplitude_db` of 0 means no shadows. Walls are the arena's
    obstacles; `crossing_db` and `inside_db_per_m` of 0 mean none. Callers give the distance, since the last bit of a
    run depends on how it was rounded.
    """
    loss = loss_db(curve, distance_m)
    if amplitude_db > 0.0:
        loss += shadowing_db(waves, amplitude_db, ax, ay, bx, by)
    if crossing_db > 0.0 or inside_db_per_m > 0.0:
        loss += wall_loss_db(obstacles, arena, crossing_db, inside_db_per_m, ax, ay, bx, by)
    return loss
