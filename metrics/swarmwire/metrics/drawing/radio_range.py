"""Who is in whose radio range, from positions alone."""

import numpy as np

from swarmwire.comms.arrays import AnyArray, BoolArray, IntArray


def in_range(position_m: AnyArray, alive: BoolArray, range_m: float) -> IntArray:
    """Pairs (e, 2) of robots alive that are no farther apart than the range.

    Walls in the line of sight, partitions and failed radios are not regarded: a run folder holds no links.
    """
    from scipy.spatial import cKDTree

    living = np.flatnonzero(alive)
    pairs = cKDTree(position_m[living]).query_pairs(range_m, output_type="ndarray")
    return living[pairs].astype(np.int64)
