"""Intervals of confidence: the bootstrap (Efron, Ann. Statist. 7, 1979), of seeds or of blocks of ticks, and Wilson's.

Whole seeds are resampled, since all runs of a seed start alike: a seed that is drawn brings all its values (Field and
Welsh, J. R. Stat. Soc. B 69, 2007). Draws are keyed by the number of seeds alone: the same data always give the same
interval. Counts of draws are cached, so that an interval of a median of 50 values takes about 0.1 ms.
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

WORDS = 4  # that one draw brings, of 32 bits
RESAMPLES = 2000
MIN_RESAMPLES = 400  # of very large samples, where intervals are narrow anyhow
DRAWS = 2_000_000  # per statistic, at most, as long as there are more than the fewest
KEY = derive_key("statistics")
DRAW = purpose("bootstrap")
BLOCKS = 10
MIN_TICKS = 5  # of a block
MAX_STRETCH = 3.0  # of an end of an interval of a mean, to that of the percentile interval
ROUNDING = 1e-5  # of squares, relative: below that a resample has no variance
EQUAL = 1e-12  # of deviations from the mean, relative to the values: below that these are equal
SKEWED = 1.5  # |skewness|: 5 % of normal samples of 8 are beyond it, of 30 none


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


def drawn_by_seed(seed: IntArray, sample: int = 0) -> tuple[Counts, int]:
    """How often each value is drawn in each resample of the seeds, (resamples, n); and the number of seeds.

    `seed` (n,) is the seed of each value.
    """
    seeds, first, place = np.unique(seed, return_index=True, return_inverse=True)
    if len(seeds) == len(seed):
        return drawn(len(seed), sample), len(seed)
    in_order = np.argsort(np.argsort(first))  # by first occurrence, so that rows of one run each are drawn as they are
    return drawn(len(seeds), sample)[:, in_order[place]], len(seeds)


@dataclass(frozen=True)
class Means:
    """A mean with its squared standard error, and both of each resample, (resamples,)."""

    mean: float
    squared_error: float
    resampled: FloatArray
    squared_errors: FloatArray
    seeds: int

    def less(self, other: "Means") -> "Means":
        """The difference from the mean of another sample, which was drawn independently."""
        fewer = min(len(self.resampled), len(other.resampled))
        return Means(
            self.mean - other.mean,
            self.squared_error + other.squared_error,
            self.resampled[:fewer] - other.resampled[:fewer],
            self.squared_errors[:fewer] + other.squared_errors[:fewer],
            min(self.seeds, other.seeds),
        )

    def interval(self, level: float = LEVEL) -> Interval:
        """The bootstrap-t interval (Efron and Tibshirani, 1993, section 12.5), which follows skewness.

        Its ends are mean - t error, with the quantiles of t = (resampled mean - mean) / error of the resample. Each end
        is at most three times as far from the mean as that of the expanded percentile interval: of few distinct
        values, many resamples have no variance and thus no finite t. The mean alone of equal values, NaN of fewer than
        two seeds.
        """
        low, high = percentile_interval(self.resampled, self.seeds, level)
        if math.isnan(low) or self.squared_error == 0.0:
            return Interval(low, high)
        moved = self.resampled - self.mean
        has_variance = self.squared_errors > ROUNDING * self.squared_error
        error = np.sqrt(np.where(has_variance, self.squared_errors, 1.0))
        t = np.sort(np.where(has_variance, moved / error, np.copysign(np.inf, moved)))
        place = math.floor(0.5 * (1.0 - level) * len(t))
        below, above = math.sqrt(self.squared_error) * np.array([t[-1 - place], -t[place]])
        return Interval(
            self.mean - min(float(below), MAX_STRETCH * (self.mean - low)),
            self.mean + min(float(above), MAX_STRETCH * (high - self.mean)),
        )


def bootstrapped_mean(value: FloatArray, seed: IntArray | None = None, sample: int = 0) -> Means:
    """The mean of values (n,) with their seeds, and of its resamples; without seeds each value has its own.

    The squared error is sum r² / n², with r the sum of a seed's deviations from the mean.
    """
    mean = float(value.mean())
    first, place = (np.arange(len(value)),) * 2 if seed is None else np.unique(seed, True, True)[1:]
    in_order = np.argsort(np.argsort(first))[place]
    runs = np.bincount(in_order).astype(np.float64)
    deviation = np.bincount(in_order, value - mean)
    scale = float(np.max(np.abs(deviation)))  # so that squares fit the counts' precision
    if scale <= EQUAL * float(np.max(np.abs(value))):  # equal values, but for the rounding of their mean
        deviation, scale = np.zeros_like(deviation), 1.0
    deviation /= scale
    terms = np.stack([runs, deviation, deviation**2, deviation * runs, runs**2], axis=1)
    count, total, squares, mixed, squared_count = (drawn(len(runs), sample) @ terms.astype(np.float32)).T.astype(float)
    moved = total / count
    squared_errors = np.maximum(squares - 2.0 * moved * mixed + moved**2 * squared_count, 0.0) / count**2
    squared_error = float(np.sum(deviation**2)) / len(value) ** 2
    return Means(mean, squared_error * scale**2, mean + moved * scale, squared_errors * scale**2, len(runs))


def is_skewed(value: FloatArray) -> bool:
    """Whether the skewness of values (n,) is beyond ±1.5, so that intervals of their mean may cover less than they say.

    It is Fisher and Pearson's, sqrt(n (n - 1)) / (n - 2) m3 / m2^1.5 (Joanes and Gill, The Statistician 47, 1998).
    """
    n = len(value)
    deviation: FloatArray = value - float(value.mean())
    squares = float(np.mean(deviation**2))
    if n < 3 or squares <= 0.0:
        return False
    skewness = math.sqrt(n * (n - 1)) / (n - 2) * float(np.mean(deviation**3)) / squares**1.5
    return abs(skewness) > SKEWED


def resampled_medians(value: FloatArray, seed: IntArray | None = None, sample: int = 0) -> FloatArray:
    """The median of each resample, (resamples,), of values (n,) with their seeds; without seeds each has its own."""
    rising = np.sort(value)
    if seed is None or len(np.unique(seed)) == len(seed):
        lower, upper = _middle(len(value), sample)
    else:
        lower, upper = _middle_of(drawn_by_seed(seed, sample)[0][:, np.argsort(value)])
    return 0.5 * (rising[lower] + rising[upper])


def percentile_interval(resampled: FloatArray, n: int, level: float = LEVEL) -> Interval:
    """The expanded percentile interval of a statistic's values in resamples of n seeds; values may be infinite.

    The plain one is too narrow by sqrt((n - 1) / n) and by that of the normal for Student's distribution; here its
    tails are Phi(-t sqrt(n / (n - 1))) with n - 1 degrees of freedom (Hesterberg, The American Statistician 69, 2015).
    NaN of fewer than two seeds.
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
    return _middle_of(drawn(n, sample))


def _middle_of(counts: Counts) -> tuple[IntArray, IntArray]:
    """Places, in rising order of all values, of the two (or one) in the middle of each resample, (resamples,) each."""
    below = np.cumsum(counts, axis=1)
    total = below[:, -1:]
    return np.argmax(below > (total - 1.0) // 2.0, axis=1), np.argmax(below > total // 2.0, axis=1)


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
    moved = bootstrapped_mean(blocks[1], sample=1).less(bootstrapped_mean(blocks[0]))
    return percentile_interval(moved.resampled, min(map(len, blocks)), level)


def binomial_interval(
    successes: IntArray | FloatArray, trials: IntArray | FloatArray, confidence: float = 0.95
) -> tuple[FloatArray, FloatArray]:
    """Wilson's score interval of a probability, lower and upper ends (k,); NaN without a trial.

    With p = successes / trials = s / n: (p + z^2 / 2n ± z sqrt(p (1 - p) / n + z^2 / 4n^2)) / (1 + z^2 / n). Trials are
    taken to be independent. It stays within 0 and 1, also for shares of 0 and 1.

    Source: E. B. Wilson, Probable inference, the law of succession, and statistical inference, JASA 22 (1927) 209-212.
    """
    z2 = NormalDist().inv_cdf(0.5 + 0.5 * confidence) ** 2
    n = np.where(np.asarray(trials) > 0, trials, np.nan).astype(np.float64)
    share = np.asarray(successes) / n
    half = np.sqrt(z2 * (share * (1.0 - share) / n + z2 / (4.0 * n * n)))
    middle = share + z2 / (2.0 * n)
    # Rounding would leave an end of a share of 0 or 1 just beside it.
    low = np.where(share == 0.0, 0.0, (middle - half) / (1.0 + z2 / n))
    high = np.where(share == 1.0, 1.0, (middle + half) / (1.0 + z2 / n))
    return low, high
