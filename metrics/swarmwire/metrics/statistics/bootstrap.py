"""The bootstrap: how a statistic of n values would change had other runs been drawn (Efron, Ann. Statist. 7, 1979).

Draws are keyed by n alone, so that a statistic of the same data is the same always; how often each value is drawn is
worked out once per n, which makes the interval of a median of 50 values a matter of 0.1 ms.
"""

import math
from functools import lru_cache
from statistics import NormalDist
from typing import Any

import numpy as np
from scipy import special

from swarmwire.comms.arrays import AnyArray, FloatArray, IntArray
from swarmwire.comms.draws import derive_key, purpose, uniform
from swarmwire.metrics.statistics.interval import LEVEL, UNKNOWN, Interval

RESAMPLES = 2000
FEWEST_RESAMPLES = 400  # of very large samples, where intervals are narrow anyhow
DRAWS = 2_000_000  # per statistic, at most, as long as there are more than the fewest
KEY = derive_key("statistics")
DRAW = purpose("bootstrap")


def drawn(n: int, sample: int = 0) -> FloatArray:
    """How often each of n values is drawn in each resample, (resamples, n); every row adds up to n.

    Another `sample` draws independently: for the second of two that are not paired.
    """
    return _counts(n, sample).astype(np.float64)


def resampled_means(value: FloatArray, sample: int = 0) -> FloatArray:
    """The mean of each resample, (resamples,), of values (n,); of (…, n) it is (resamples, …)."""
    n = value.shape[-1]
    means: FloatArray = np.tensordot(drawn(n, sample), value, axes=(1, -1)) / n
    return means


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
def _counts(n: int, sample: int) -> AnyArray:
    """As `drawn`, in a byte each: no value is drawn 255 times but with a chance of 1e-500."""
    resamples = min(RESAMPLES, max(FEWEST_RESAMPLES, DRAWS // max(n, 1)))
    resample, place = np.arange(resamples)[:, None], np.arange(n)
    picked = np.floor(uniform(KEY, DRAW, sample, resample, place) * n).astype(np.int64)
    flat = np.bincount((picked + resample * n).ravel(), minlength=resamples * n)
    counts = flat.reshape(resamples, n).astype(np.uint8)
    counts.setflags(write=False)
    return counts


@lru_cache(maxsize=32)
def _middle(n: int, sample: int) -> tuple[IntArray, IntArray]:
    """Places, in rising order of all values, of the two (or one) in the middle of each resample."""
    below = np.cumsum(_counts(n, sample), axis=1, dtype=np.int64)
    return np.argmax(below > (n - 1) // 2, axis=1), np.argmax(below > n // 2, axis=1)
