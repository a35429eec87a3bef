"""Percentiles in constant memory: a histogram whose bins grow with the value, so that the error is relative."""

# pyright: basic, reportUnknownMemberType=false

import math

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.kernels import njit

RELATIVE_ERROR = 0.005
LARGEST_NS = 10**14  # a little more than a day; what is longer counts as this

# Bin 0 holds zero; bin b + 1 values in (g^(b-1), g^b], and 2 g^b / (g + 1) is within (g - 1) / (g + 1) of all of them.
_GROWTH = (1.0 + RELATIVE_ERROR) / (1.0 - RELATIVE_ERROR)
_LOG_GROWTH = math.log(_GROWTH)
_BINS = 2 + math.ceil(math.log(LARGEST_NS) / _LOG_GROWTH)


class LogHistogram:
    """Durations in ns, counted per arena; 26 kB an arena.

    A percentile is that of the nearest rank (the smallest value that at least that share does not exceed, numpy's
    "inverted_cdf"), within a relative error of 0.5 % for 1 ns to 10^14 ns. Zero, and what is less, counts as zero.

    Source: C. Masson, J. Rim, H. Lee, DDSketch: a fast and fully-mergeable quantile sketch with relative-error
    guarantees, PVLDB 12 (2019), section 2.
    """

    def __init__(self, arenas: int) -> None:
        """An empty histogram for each arena."""
        self._count: IntArray = np.zeros((arenas, _BINS), np.int64)

    def add(self, arena: IntArray, duration_ns: IntArray) -> None:
        """Count these durations, (k,), each in its arena, (k,)."""
        _count(self._count, arena, duration_ns)

    def percentiles_ns(self, arena: int, percents: tuple[float, ...]) -> FloatArray:
        """The percentiles in ns, one for each of `percents` (0 to 100); NaN of nothing."""
        running = np.cumsum(self._count[arena])
        if running[-1] == 0:
            return np.full(len(percents), np.nan)
        share = np.array(percents, np.float64) / 100.0
        rank: FloatArray = np.maximum(np.ceil(share * running[-1]), 1.0)
        bins: IntArray = np.array([running.searchsorted(one) for one in rank], np.int64)
        return np.where(bins > 0, 2.0 * np.power(_GROWTH, bins - 1.0) / (_GROWTH + 1.0), 0.0)


@njit()
def _count(count, arena, duration_ns):
    last_ns, place = 0, 0
    for i in range(len(duration_ns)):
        if duration_ns[i] != last_ns:  # a logarithm less for each receiver of a packet but the first
            last_ns, place = duration_ns[i], 0
            if last_ns > 0:
                place = math.ceil(math.log(min(last_ns, LARGEST_NS)) / _LOG_GROWTH) + 1
        count[arena[i], place] += 1
