"""Who is in whose radio range, from positions alone."""

from typing import Any, cast

import numpy as np
from scipy.spatial import KDTree

from swarmwire.comms.arrays import AnyArray, BoolArray, IntArray


def in_range(position_m: AnyArray, alive: BoolArray, range_m: float) -> IntArray:
    """Pairs (e, 2) of robots alive that are no farther apart than the range.

    Walls in the line of sight, partitions and failed radios are not regarded: a run folder holds no links.
    """
    living = np.flatnonzero(alive)
    tree = cast(Any, KDTree)(position_m[living])  # its stub types the answers in part only
    pairs: IntArray = tree.query_pairs(range_m, output_type="ndarray")
    return living[pairs]
