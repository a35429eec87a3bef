"""Curves with fewer points than they have, in which every peak can still be seen."""

from itertools import pairwise

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray

MAX_POINTS = 800  # of a curve: about what a figure has dots for across


def thinned(value: FloatArray, most: int = MAX_POINTS) -> IntArray:
    """The places to draw of a curve (T,), rising: all, or of each stretch the least and the greatest value.

    A stretch without any value keeps its first place, so that a gap stays one.
    """
    if len(value) <= most:
        return np.arange(len(value))
    kept: set[int] = {0, len(value) - 1}
    bounds = np.linspace(0, len(value), most // 2 + 1).astype(int).tolist()
    for first, after in pairwise(bounds):
        stretch = value[first:after]
        known = np.flatnonzero(np.isfinite(stretch))
        if not len(known):
            kept.add(first)
            continue
        kept |= {first + int(known[stretch[known].argmin()]), first + int(known[stretch[known].argmax()])}
    return np.array(sorted(kept))
