"""The radius of each robot's body, as metrics of distances need it."""

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.truth import Static


def radii_m(static: Static) -> FloatArray:
    """Of each robot index within an arena, (robots,)."""
    return np.concatenate([np.full(group.stop - group.start, group.body.radius_m) for group in static.groups])
