"""Angles on a circle, wrapped into one turn.

`wrap_angle` and `wrap_angles` are one formula, for one angle and for arrays: a - 2 pi ceil((a - pi) / (2 pi)). They
keep the bits of an angle in (-pi, pi], and are exact up to three half turns (Sterbenz's lemma).

`wrap_by_atan2` and `wrap_by_modulo` round at other points. They remain where these last bits are part of a run: the
rays of bundled bodies, and the turns of behaviours.
"""

import numpy as np

from swarmwire.comms.base import math as portable
from swarmwire.comms.base.arrays import FloatArray

TURN_RAD = 2.0 * np.pi
MIN_ANGLE_RAD = np.nextafter(-np.pi, 0.0)  # the least angle in (-pi, pi]


def wrap_angle(angle_rad: float) -> float:
    """Wrap an angle to (-pi, pi]. Kernels compile it: `njit()(wrap_angle)`."""
    if -np.pi < angle_rad <= np.pi:
        return angle_rad
    wrapped = angle_rad - TURN_RAD * np.ceil((angle_rad - np.pi) / TURN_RAD)
    return min(max(wrapped, MIN_ANGLE_RAD), np.pi)  # the last bit of the product may step over an end


def wrap_angles(angle_rad: FloatArray) -> FloatArray:
    """Wrap angles of any shape to (-pi, pi], bit for bit as `wrap_angle` does."""
    wrapped = angle_rad - TURN_RAD * np.ceil((angle_rad - np.pi) / TURN_RAD)
    inside = (angle_rad > -np.pi) & (angle_rad <= np.pi)
    return np.where(inside, angle_rad, np.clip(wrapped, MIN_ANGLE_RAD, np.pi))


def wrap_by_atan2(angle_rad: FloatArray) -> FloatArray:
    """Wrap angles of any shape to [-pi, pi]; angles in this range change by up to 2 units in the last place."""
    return portable.atan2(portable.sin(angle_rad), portable.cos(angle_rad))


def wrap_by_modulo(angle_rad: FloatArray) -> FloatArray:
    """Wrap angles of any shape to [-pi, pi); angles in this range change by up to 1e-15 rad."""
    return (angle_rad + np.pi) % TURN_RAD - np.pi
