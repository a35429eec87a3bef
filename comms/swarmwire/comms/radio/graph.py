"""The radio graph: the robots that are joined by a link, in either radio model.

Two robots are joined if a lone packet is delivered in both directions with at least `min_delivery`, fast fading left
out. A radio model finds the candidate pairs, and computes the delivery of each.
"""

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray

# Tolerance: 1 - 0.9 is slightly below 0.1 in floating point.
ROUNDING = 1e-9


def is_enough(delivery: FloatArray | float, min_delivery: float) -> BoolArray:
    """Whether two robots with this delivery in the worse direction are joined."""
    return np.asarray(delivery >= min_delivery - ROUNDING)


def edges(pair: IntArray, delivery: FloatArray | float, min_delivery: float) -> IntArray:
    """The pairs of robot rows (k, 2) whose `delivery` in the worse direction, (k,) or one for all, is enough; (e, 2).

    The edges are in the order of the pairs: a < b in each, sorted.
    """
    joined = is_enough(delivery, min_delivery)
    return pair if joined.all() else pair[np.broadcast_to(joined, len(pair))]
