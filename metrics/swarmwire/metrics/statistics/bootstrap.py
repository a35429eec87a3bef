"""The bootstrap: how a statistic of n values would change had other runs been drawn (Efron, Ann. Statist. 7, 1979).

Draws are keyed by n alone, so that a statistic of the same data is the same always; how often each value is drawn is
worked out once per n, which makes the interval of a median of 50 values a matter of 0.1 ms.
"""

import math
from functools import lru_cache
from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import special

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.draws import derive_key, philox, purpose
from swarmwire.metrics.statistics.interval import LEVEL, UNKNOWN, Interval

Counts = NDArray[np.float32]

WORDS = 4  # that one draw brings, of 32 bits
RESAMPLES = 2000
MIN_RESAMPLES = 400  # of very large samples, where intervals are narrow anyhow
DRAWS = 2_000_000  # per statistic, at most, as long as there are more than the fewest
KEY = derive_key("statistics")
DRAW = purpose("bootstrap")


@lru_cache(maxsize=16)
def drawn(n: int, sample: int = 0) -> Counts:
    """How often each of n values is drawn in each resample, (resamples, n); every row adds up to n. Not to be changed.

    Another `sample` draws independently: for the second of two that are not paired.
    """
    resamples = min(RESAMPLES, max(MIN_RESAMPLES, DRAWS // max(n, 1)))
    resample, four = np.arange(resamples)[:, None], np.arange(-(-n // WORDS))
    words = np.stack(philox(KEY, DRAW, sample, resample, four), axis=-1).reshape(resamples, -1)[:, :n]
    picked = (words * np.uint64(n) >> np.uint64(32)).astype(np.int64)  # uneven by n / 2**32 at most
    flat = np.bincount((picked + resample * n).ravel(), minlength=resamples * n)
    counts = flat.reshape(resamples, n).astype(np.float32)
    counts.setflags(write=False)
    return counts


def resampled_means(value: FloatArray, sample: int = 0) -> FloatArray:
    """The mean of each resample, (resamples,), of values (n,); of (rows, n) it is (resamples, rows)."""
    n, mean = value.shape[-1], value.mean(axis=-1)
    # Deviations may well be rounded to the counts' precision: a wider product takes ten times as long for 1000 values.
    deviation = (value - mean[..., None]).astype(np.float32)
    moved: Counts = np.matmul(drawn(n, sample), deviation.T)
    return mean + moved.astype(np.float64) / n


def resampled_medians(value: FloatArray, sample: int = 0) -> FloatArray:
    """The median of each resample, (resamples,), of values (n,)."""
    lower, upper = _middle(len(value), sample)
    rising = np.sort(value)
    return 0.5 * (rising[lower] + rising[upper])


def percentile_interval(resampled: FloatArray, n: int, level: float = LEVEL) -> Interval:
    """The expanded percentile interval of a statistic's resampled values, which may be infinite.

    The plain one is too narrow by sqrt((n - 1) / n) and by that of the normal for Student's distribution; here its
    tails are Phi(-t sqrt(n / (n - 1))) with n - 1 degrees of freedom (Hesterberg, The American Statistician 69, 2015).
    NaN of fewer than two values.
    """
    if n < 2 or np.isnan(resampled).any():
        return UNKNOWN
    student: Any = special.stdtrit(n - 1, 0.5 + 0.5 * level)
    tail = NormalDist().cdf(-float(student) * math.sqrt(n / (n - 1)))
    rising = np.sort(resampled)
    place = math.floor(tail * len(rising))
    return Interval(float(rising[place]), float(rising[-1 - place]))


@lru_cache(maxsize=32)
def _middle(n: int, sample: int) -> tuple[IntArray, IntArray]:
    """Places, in rising order of all values, of the two (or one) in the middle of each resample."""
    below = np.cumsum(drawn(n, sample), axis=1)
    return np.argmax(below > (n - 1) // 2, axis=1), np.argmax(below > n // 2, axis=1)
