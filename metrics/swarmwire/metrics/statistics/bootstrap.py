"""Confidence intervals: the bootstrap (Efron, Ann. Statist. 7, 1979) of seeds or of blocks of ticks, and Wilson's.

Seeds are resampled with all their values, since all runs of a seed start alike (cluster bootstrap: Field and Welsh,
J. R. Stat. Soc. B 69, 2007). Draws are keyed by the number of seeds only: the same data always give the same interval.
Counts of draws are cached, so that an interval of a median of 50 values takes about 0.1 ms.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import special

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.draws import derive_key, philox, purpose
from swarmwire.metrics.statistics.sample import LEVEL, UNKNOWN, Interval

Counts = NDArray[np.float32]

WORDS = 4  # 32-bit words per draw
RESAMPLES = 2000
MIN_RESAMPLES = 400  # very large samples have narrow intervals
DRAWS = 2_000_000  # upper bound per statistic, except for MIN_RESAMPLES
KEY = derive_key("statistics")
DRAW = purpose("bootstrap")
BLOCKS = 10
MIN_TICKS = 5  # per block
MAX_STRETCH = 3.0  # largest ratio of an end's distance from the mean to that of the percentile interval
ROUNDING = 1e-5  # relative; squares below it mean that a resample has no variance
EQUAL = 1e-12  # relative; deviations from the mean below it mean that the values are equal
SKEWED = 1.5  # |skewness|: exceeded by 5 % of normal samples of 8, by no sample of 30


@lru_cache(maxsize=16)
def draw_counts(n: int, sample: int = 0) -> Counts:
    """Return the number of draws of each of n values in each resample, (resamples, n), read-only; rows add up to n.

    Another `sample` draws independently: for the second of two that are not paired.
    """
    resamples = min(RESAMPLES, max(MIN_RESAMPLES, DRAWS // max(n, 1)))
    resample, quadruple = np.arange(resamples)[:, None], np.arange(-(-n // WORDS))
    words = np.stack(philox(KEY, DRAW, sample, resample, quadruple), axis=-1).reshape(resamples, -1)[:, :n]
    picked = (words * np.uint64(n) >> np.uint64(32)).astype(np.int64)  # bias of n / 2**32 at most
    flat = np.bincount((picked + resample * n).ravel(), minlength=resamples * n)
    counts = flat.reshape(resamples, n).astype(np.float32)
    counts.setflags(write=False)
    return counts


def draw_counts_by_seed(seed: IntArray, sample: int = 0) -> tuple[Counts, int]:
    """Return the number of draws of each value in each resample of the seeds, (resamples, n), and the number of seeds.

    `seed` (n,) is the seed of each value.
    """
    seeds, first, index = np.unique(seed, return_index=True, return_inverse=True)
    if len(seeds) == len(seed):
        return draw_counts(len(seed), sample), len(seed)
    order = np.argsort(np.argsort(first))  # the order of first occurrence
    return draw_counts(len(seeds), sample)[:, order[index]], len(seeds)


@dataclass(frozen=True)
class Means:
    """A mean with its squared standard error, and the two for each resample, (resamples,)."""

    mean: float
    squared_error: float
    resampled: FloatArray
    squared_errors: FloatArray
    seeds: int

    def minus(self, other: "Means") -> "Means":
        """Return the difference from the mean of another sample, which was drawn independently."""
        resamples = min(len(self.resampled), len(other.resampled))
        return Means(
            self.mean - other.mean,
            self.squared_error + other.squared_error,
            self.resampled[:resamples] - other.resampled[:resamples],
            self.squared_errors[:resamples] + other.squared_errors[:resamples],
            min(self.seeds, other.seeds),
        )

    def interval(self, level: float = LEVEL) -> Interval:
        """Return the bootstrap-t interval (Efron and Tibshirani, 1993, section 12.5), which adapts to skewness.

        Its ends are mean - t error, with the quantiles of t = (resampled mean - mean) / error of the resample. Each end
        is at most three times as far from the mean as that of the expanded percentile interval: with few distinct
        values, many resamples have no variance and thus no finite t. Both ends are the mean if all values are equal;
        NaN with fewer than two seeds.
        """
        low, high = percentile_interval(self.resampled, self.seeds, level)
        if math.isnan(low) or self.squared_error == 0.0:
            return Interval(low, high)
        moved = self.resampled - self.mean
        has_variance = self.squared_errors > ROUNDING * self.squared_error
        error = np.sqrt(np.where(has_variance, self.squared_errors, 1.0))
        t = np.sort(np.where(has_variance, moved / error, np.copysign(np.inf, moved)))
        index = math.floor(0.5 * (1.0 - level) * len(t))
        below, above = math.sqrt(self.squared_error) * np.array([t[-1 - index], -t[index]])
        return Interval(
            self.mean - min(float(below), MAX_STRETCH * (self.mean - low)),
            self.mean + min(float(above), MAX_STRETCH * (high - self.mean)),
        )


def bootstrapped_mean(value: FloatArray, seed: IntArray | None = None, sample: int = 0) -> Means:
    """Return the mean of values (n,) with their seeds, and of its resamples; by default each value has another seed.

    The squared error is sum r² / n², with r the sum of a seed's deviations from the mean.
    """
    mean = float(value.mean())
    first, index = (np.arange(len(value)),) * 2 if seed is None else np.unique(seed, True, True)[1:]
    order = np.argsort(np.argsort(first))[index]
    runs = np.bincount(order).astype(np.float64)
    deviation = np.bincount(order, value - mean)
    scale = float(np.max(np.abs(deviation)))  # squares then fit the precision of the counts
    if scale <= EQUAL * float(np.max(np.abs(value))):  # equal values, up to the rounding of their mean
        deviation, scale = np.zeros_like(deviation), 1.0
    deviation /= scale
    terms = np.stack([runs, deviation, deviation**2, deviation * runs, runs**2], axis=1)
    count, total, squares, mixed, squared_count = (draw_counts(len(runs), sample) @ terms.astype(np.float32)).T.astype(
        float
    )
    moved = total / count
    squared_errors = np.maximum(squares - 2.0 * moved * mixed + moved**2 * squared_count, 0.0) / count**2
    squared_error = float(np.sum(deviation**2)) / len(value) ** 2
    return Means(mean, squared_error * scale**2, mean + moved * scale, squared_errors * scale**2, len(runs))


def is_skewed(value: FloatArray) -> bool:
    """Return True if the skewness of values (n,) is beyond ±1.5: intervals of their mean may cover too little.

    Skewness is Fisher and Pearson's, sqrt(n (n - 1)) / (n - 2) m3 / m2^1.5 (Joanes and Gill, The Statistician 47,
    1998).
    """
    n = len(value)
    deviation: FloatArray = value - float(value.mean())
    squares = float(np.mean(deviation**2))
    if n < 3 or squares <= 0.0:
        return False
    skewness = math.sqrt(n * (n - 1)) / (n - 2) * float(np.mean(deviation**3)) / squares**1.5
    return abs(skewness) > SKEWED


def resampled_medians(value: FloatArray, seed: IntArray | None = None, sample: int = 0) -> FloatArray:
    """Return the median of each resample, (resamples,), of values (n,); by default each value has another seed."""
    ordered = np.sort(value)
    if seed is None or len(np.unique(seed)) == len(seed):
        lower, upper = _cached_middle(len(value), sample)
    else:
        lower, upper = _middle(draw_counts_by_seed(seed, sample)[0][:, np.argsort(value)])
    return 0.5 * (ordered[lower] + ordered[upper])


def percentile_interval(resampled: FloatArray, n: int, level: float = LEVEL) -> Interval:
    """Return the expanded percentile interval of a statistic's values in resamples of n seeds; they may be infinite.

    The plain percentile interval is too narrow by sqrt((n - 1) / n), and since it uses the normal in place of Student's
    distribution; here the tails are Phi(-t sqrt(n / (n - 1))) with n - 1 degrees of freedom (Hesterberg, The American
    Statistician 69, 2015). NaN with fewer than two seeds.
    """
    if n < 2 or np.isnan(resampled).any():
        return UNKNOWN
    student: Any = special.stdtrit(n - 1, 0.5 + 0.5 * level)
    tail = NormalDist().cdf(-float(student) * math.sqrt(n / (n - 1)))
    ordered = np.sort(resampled)
    index = math.floor(tail * len(ordered))
    return Interval(float(ordered[index]), float(ordered[-1 - index]))


@lru_cache(maxsize=32)
def _cached_middle(n: int, sample: int) -> tuple[IntArray, IntArray]:
    return _middle(draw_counts(n, sample))


def _middle(counts: Counts) -> tuple[IntArray, IntArray]:
    """Return the indices, in sorted order, of the two values (or one) in the middle of each resample, (resamples,)."""
    below = np.cumsum(counts, axis=1)
    total = below[:, -1:]
    return np.argmax(below > (total - 1.0) // 2.0, axis=1), np.argmax(below > total // 2.0, axis=1)


def block_means(series: FloatArray) -> FloatArray:
    """Return the means of 10 blocks of equal lengths, (blocks,); fewer if the series (n,) is short."""
    blocks = min(BLOCKS, len(series) // MIN_TICKS)
    length = len(series) // blocks if blocks else 0
    return series[len(series) - blocks * length :].reshape(blocks, length).mean(axis=1) if blocks else np.zeros(0)


def mean_difference_interval(a: FloatArray, b: FloatArray, level: float = LEVEL) -> Interval:
    """Return the interval of mean(b) - mean(a), for independent series of finite values (n,) and (m,).

    NaN if a series is too short for two blocks.
    """
    blocks = block_means(a), block_means(b)
    if min(map(len, blocks)) < 2:
        return UNKNOWN
    means = bootstrapped_mean(blocks[1], sample=1).minus(bootstrapped_mean(blocks[0]))
    return percentile_interval(means.resampled, min(map(len, blocks)), level)


def binomial_interval(
    successes: IntArray | FloatArray, trials: IntArray | FloatArray, confidence: float = 0.95
) -> tuple[FloatArray, FloatArray]:
    """Return Wilson's score interval of a probability, lower and upper ends (k,); NaN without a trial.

    With p = successes / trials = s / n: (p + z^2 / 2n ± z sqrt(p (1 - p) / n + z^2 / 4n^2)) / (1 + z^2 / n). Trials are
    assumed independent. The ends stay within 0 and 1, also for shares of 0 and 1.

    Source: E. B. Wilson, Probable inference, the law of succession, and statistical inference, JASA 22 (1927) 209-212.
    """
    z2 = NormalDist().inv_cdf(0.5 + 0.5 * confidence) ** 2
    n = np.where(np.asarray(trials) > 0, trials, np.nan).astype(np.float64)
    share = np.asarray(successes) / n
    half = np.sqrt(z2 * (share * (1.0 - share) / n + z2 / (4.0 * n * n)))
    middle = share + z2 / (2.0 * n)
    # Without this, rounding moves the end of a share of 0 or 1.
    low = np.where(share == 0.0, 0.0, (middle - half) / (1.0 + z2 / n))
    high = np.where(share == 1.0, 1.0, (middle + half) / (1.0 + z2 / n))
    return low, high
