"""Where candidates for a place lie, and the keyed draws that give them. Compiled."""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np
from numba import njit

from swarmwire.comms.draws_compiled import uniform

BOX, DISC, RING = range(3)
TURN_RAD = 2.0 * np.pi


class Region(NamedTuple):
    """Where candidates lie."""

    kind: int  # BOX, DISC or RING
    x_m: float
    y_m: float
    half_x_m: float  # the radius of a disc, the outer one of a ring
    half_y_m: float
    inner_m: float  # inner radius of a ring


@njit(cache=True)
def candidate(region, key, entity, attempt, purpose):
    """Candidate `attempt` of an entity: x, y, whether it lies in the region."""
    u = uniform(key, entity, attempt, 0, purpose)
    v = uniform(key, entity, attempt, 1, purpose)
    if region.kind == RING:
        inner2 = region.inner_m * region.inner_m
        r = np.sqrt(inner2 + u * (region.half_x_m * region.half_x_m - inner2))
        return region.x_m + r * np.cos(TURN_RAD * v), region.y_m + r * np.sin(TURN_RAD * v), True
    u, v = 2.0 * u - 1.0, 2.0 * v - 1.0
    inside = region.kind == BOX or u * u + v * v <= 1.0
    return region.x_m + u * region.half_x_m, region.y_m + v * region.half_y_m, inside
