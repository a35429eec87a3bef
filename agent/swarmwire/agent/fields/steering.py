"""From the vector that a robot wants to follow to how it drives."""

import numpy as np

from swarmwire.agent.fields.vectors import Vectors
from swarmwire.comms.arrays import FloatArray


def steered(wanted: Vectors, speed_mps: float, turn_gain_per_s: float) -> tuple[FloatArray, FloatArray]:
    """Forward speed in m/s and turn rate in rad/s, (n,) each, for `robots.drive`.

        v = speed_mps max(cos a, 0),    w = turn_gain_per_s a

    with a the angle to what is wanted: the more a robot has to turn the slower it drives, and what is behind it it
    turns to on the spot. Where nothing is wanted it drives straight on.
    """
    angle = wanted.angle_rad
    return speed_mps * np.maximum(np.cos(angle), 0.0), turn_gain_per_s * angle
