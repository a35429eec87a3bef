"""Differences of the means of two series whose ticks depend on one another: the bootstrap of blocks.

A series is cut into blocks that do not overlap, and their means are drawn with replacement: what lasts less than a
block is then within one (Carlstein, Ann. Statist. 14, 1986). What lasts longer makes intervals too narrow.
"""

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.metrics.statistics.bootstrap import percentile_interval, resampled_means
from swarmwire.metrics.statistics.interval import LEVEL, UNKNOWN, Interval

BLOCKS = 10
MIN_TICKS = 5  # of a block


def block_means(series: FloatArray) -> FloatArray:
    """The means of 10 blocks of equal lengths, of fewer if the series (n,) is short, (blocks,)."""
    blocks = min(BLOCKS, len(series) // MIN_TICKS)
    length = len(series) // blocks if blocks else 0
    return series[len(series) - blocks * length :].reshape(blocks, length).mean(axis=1) if blocks else np.zeros(0)


def mean_difference_interval(a: FloatArray, b: FloatArray, level: float = LEVEL) -> Interval:
    """The interval of mean(b) - mean(a), of series of finite values (n,) and (m,) that were measured independently.

    NaN if one of them is too short for two blocks.
    """
    blocks = block_means(a), block_means(b)
    if min(map(len, blocks)) < 2:
        return UNKNOWN
    moved = resampled_means(blocks[1], sample=1) - resampled_means(blocks[0])
    return percentile_interval(moved, min(map(len, blocks)), level)
