"""Angles: the same direction in another turn."""

import numpy as np

from swarmwire.comms.arrays import FloatArray


def wrapped(angle_rad: FloatArray) -> FloatArray:
    """The same directions within [-pi, pi)."""
    return (angle_rad + np.pi) % (2.0 * np.pi) - np.pi
