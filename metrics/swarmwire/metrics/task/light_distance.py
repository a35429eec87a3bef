"""How far robots are from the nearest light of their arena."""

from collections.abc import Callable

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.truth import Static
from swarmwire.metrics.moment import Moment
from swarmwire.metrics.torus import shortest


def light_distance(static: Static) -> Callable[[Moment], FloatArray] | None:
    """To each robot's distance in m from its centre to the nearest light, (arenas, robots); inf where there is none.

    None if no arena has a light.
    """
    lights = static.lights or ((),) * static.arenas
    if not any(lights):
        return None
    at_m: FloatArray = np.full((static.arenas, max(map(len, lights), default=0), 2), np.inf)
    for arena, own in enumerate(lights):
        at_m[arena, : len(own)] = np.array([(light.x_m, light.y_m) for light in own]).reshape(-1, 2)

    def measure(moment: Moment) -> FloatArray:
        # (arenas, robots, lights, 2)
        away = shortest(moment.position_m[:, :, None, :] - at_m[:, None, :, :], static)
        return np.min(np.hypot(away[..., 0], away[..., 1]), axis=2, initial=np.inf)

    return measure
