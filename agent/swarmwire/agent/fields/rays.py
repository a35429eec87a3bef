"""Fields of what rays see: a vector for each robot, away from what is near."""

from typing import Any

import numpy as np

from swarmwire.agent.fields.vectors import Vectors
from swarmwire.agent.readings import ProximityReading
from swarmwire.comms.arrays import FloatArray


def repulsion_of_rays(proximity: ProximityReading[Any]) -> Vectors:
    """Away from what the rays of `proximity` see, (n,): minus the sum of the rays' vectors, each `value` (0 to 1) long.

    One that sees a thing at touching distance is a vector of length 1; what is far adds nothing.
    """
    x, y = proximity.vector_sum()
    return Vectors(-x, -y)


def repulsion_of_ranges(range_m: FloatArray, angle_rad: FloatArray, reach_m: float) -> Vectors:
    """Away from what is nearer than `reach_m`, (n,): minus the mean of the rays' vectors, each 1 - d / reach_m long.

    `range_m` (n, rays) is inf or more than `reach_m` where a ray sees nothing, `angle_rad` (rays,) is where it looks,
    as a laser scan has them. As a mean over all rays it is the same for a scanner with more of them; a wall that
    fills the half ahead at distance 0 gives 1 / pi.

    It is minus the gradient of Khatib's (1986) repulsive potential in the bounded form reach (1 - d / reach)^2 / 2.
    """
    near = np.maximum(1.0 - range_m / reach_m, 0.0)
    rays = len(angle_rad)
    x, y = np.add.reduce(near * np.cos(angle_rad), 1), np.add.reduce(near * np.sin(angle_rad), 1)
    return Vectors(-x / rays, -y / rays)
