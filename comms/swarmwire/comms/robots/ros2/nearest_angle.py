"""Which of some directions lies nearest to each of others, around the circle."""

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray

TURN_RAD = 2.0 * np.pi


def nearest_angle(of_rad: FloatArray, among_rad: FloatArray) -> tuple[IntArray, FloatArray]:
    """For each angle `of_rad` (n,) the place of the nearest `among_rad` (m,), and how far apart they are, in rad."""
    among = np.mod(among_rad, TURN_RAD)
    order = np.argsort(among, kind="stable")
    around = np.concatenate([among[order[-1:]] - TURN_RAD, among[order], among[order[:1]] + TURN_RAD])
    at = np.mod(of_rad, TURN_RAD)
    after = np.clip(np.searchsorted(around, at), 1, len(around) - 1)
    before_rad, after_rad = at - around[after - 1], around[after] - at
    place = np.where(before_rad <= after_rad, after - 2, after - 1) % len(order)
    return order[place].astype(np.int64), np.minimum(before_rad, after_rad)
