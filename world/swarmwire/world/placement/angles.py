"""Angles as the contract has them."""

import numpy as np

from swarmwire.comms.arrays import FloatArray


def wrapped(angle_rad: FloatArray) -> FloatArray:
    """Angles of any shape in (-pi, pi]; those already there keep their bits."""
    turned = angle_rad - 2.0 * np.pi * np.ceil((angle_rad - np.pi) / (2.0 * np.pi))
    turned = np.clip(turned, np.nextafter(-np.pi, 0.0), np.pi)  # the last bit of the product may step over an end
    return np.where((angle_rad > -np.pi) & (angle_rad <= np.pi), angle_rad, turned)
