"""How a second sample differs from a first: the size of the difference, its interval, a test, and effect sizes.

Where two seeds or more are in both, these are compared seed by seed: runs of one seed begin alike, so that their
difference varies less than either. Else the samples are compared as wholes. Failed runs take no part.
"""

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from scipy import stats

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.metrics.statistics.bootstrap import (
    bootstrapped_mean,
    drawn,
    is_skewed,
    percentile_interval,
    resampled_medians,
)
from swarmwire.metrics.statistics.sample import LEVEL, UNKNOWN, Interval, Sample
from swarmwire.metrics.statistics.survival import (
    common_horizon,
    kaplan_meier,
    log_rank,
    paired_p,
    resampled_quantiles,
    surely_less,
)

Test = Literal["Wilcoxon signed-rank", "Mann-Whitney", "paired Gehan", "log-rank"]
MIN_PAIRS = 2
MAX_DISCRETE = 10  # distinct values of a discrete outcome, in both samples


def cliffs_delta(first: Sample, second: Sample) -> float:
    """P(first > second) - P(first < second) over all pairs, -1 to 1 (Cliff, Psychol. Bull. 114, 1993); NaN of none.

    It is 2 A - 1 with A of Vargha and Delaney (2000). Of censored times, pairs whose order is unknown count as equal
    (Gehan, Biometrika 52, 1965): so the value errs towards 0.
    """
    pairs = len(first) * len(second)
    if not pairs:
        return math.nan
    return float(surely_less(first, second).sum() - surely_less(second, first).sum()) / pairs


def hedges_g(first: FloatArray, second: FloatArray) -> float:
    """(mean of first (n,) - mean of second (m,)) / pooled standard deviation, unbiased; NaN without variance.

    The factor 1 - 3 / (4 (n + m) - 9) corrects the bias of small samples (Hedges, J. Educ. Stat. 6, 1981).
    """
    freedom = len(first) + len(second) - 2
    if min(len(first), len(second)) < 1 or freedom < 1:
        return math.nan
    squares = float(np.sum((first - first.mean()) ** 2) + np.sum((second - second.mean()) ** 2))
    if squares <= 0.0:
        return math.nan
    return float(first.mean() - second.mean()) / math.sqrt(squares / freedom) * (1.0 - 3.0 / (4.0 * freedom - 1.0))


def kolmogorov_smirnov(a: FloatArray, b: FloatArray) -> float:
    """The largest difference of the shares of (n,) and of (m,) finite values up to any value, 0 to 1; NaN of nothing.

    Source: N. Smirnov, Table for estimating the goodness of fit of empirical distributions, Ann. Math. Statist. 19
    (1948).
    """
    if not (len(a) and len(b)):
        return float("nan")
    _, below_a, below_b = _shares(a, b)
    return float(np.abs(below_a - below_b).max())


def wasserstein_1(a: FloatArray, b: FloatArray) -> float:
    """How far the values of (n,) must move on average to be those of (m,), in their unit; NaN of nothing.

    The area between the two distribution functions. Source: C. Villani, Optimal Transport (2009), chapter 6.
    """
    if not (len(a) and len(b)):
        return float("nan")
    value, below_a, below_b = _shares(a, b)
    return float((np.abs(below_a - below_b)[:-1] * np.diff(value)).sum())


def _shares(a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """All values in rising order, and which shares of each sample are up to there."""
    value = np.sort(np.concatenate([a, b]))
    below = [np.searchsorted(np.sort(of), value, "right") / len(of) for of in (a, b)]
    return value, below[0], below[1]


@dataclass(frozen=True)
class Difference:
    """Second minus first; NaN: unknown."""

    pairs: int  # seeds that were compared one by one; 0: the samples were compared as wholes
    median: float  # of numbers in pairs the median of the differences, else the difference of the medians
    median_interval: Interval  # bootstrap; open where resampled medians of times lie beyond the observed times
    mean: float  # of times: of min(time, horizon)
    mean_interval: Interval  # bootstrap
    is_skewed: bool  # the differences, or a sample, so that the interval of the mean may cover less than it says
    horizon: float  # of times: up to when every run was observed; inf of numbers
    is_discrete: bool  # numbers of few values, whose medians hardly move: the mean tells more
    delta: float  # Cliff's, -1 to 1: P(second > first) - P(second < first), over all values of both
    g: float  # Hedges'; NaN of times
    p: float  # two-sided, of the test; NaN: not defined
    test: Test


def difference(first: Sample, second: Sample, level: float = LEVEL) -> Difference:
    """The difference of two samples of one kind."""
    seeds = np.intersect1d(first.seed, second.seed)
    paired = len(seeds) >= MIN_PAIRS
    one, other = (first.of_seeds(seeds), second.of_seeds(seeds)) if paired else (first, second)
    if not (len(one) and len(other)):
        test: Test = "log-rank" if first.kind == "time" else "Mann-Whitney"
        nan = math.nan
        return Difference(0, nan, UNKNOWN, nan, UNKNOWN, False, math.inf, False, nan, nan, nan, test)
    pairs = len(seeds) if paired else 0
    delta = cliffs_delta(second, first)
    if first.kind == "time":
        horizon = common_horizon([one, other])
        least = (np.minimum(one.value, horizon), np.minimum(other.value, horizon))
        p, test = (paired_p(one, other), "paired Gehan") if paired else (log_rank(one, other).p, "log-rank")
        median, mean = _medians_of_times(one, other, paired, level), _means(*least, paired, level)
        return Difference(pairs, *median, *mean, horizon, False, delta, math.nan, p, test)
    p, test = _p_of_numbers(one.value, other.value, paired)
    median, mean = _medians(one.value, other.value, paired, level), _means(one.value, other.value, paired, level)
    g = hedges_g(second.value, first.value)
    return Difference(pairs, *median, *mean, math.inf, _is_discrete(one.value, other.value), delta, g, p, test)


def _is_discrete(one: FloatArray, other: FloatArray) -> bool:
    """Whether there are few distinct values, most of them more than once."""
    distinct = len(np.unique(np.concatenate([one, other])))
    return distinct <= min(MAX_DISCRETE, (len(one) + len(other)) // 2)


def _medians(one: FloatArray, other: FloatArray, paired: bool, level: float) -> tuple[float, Interval]:
    if paired:
        resampled = resampled_medians(other - one)
        return float(np.median(other - one)), percentile_interval(resampled, len(one), level)
    return float(np.median(other) - np.median(one)), _unpaired_medians(one, other, level)


def _means(one: FloatArray, other: FloatArray, paired: bool, level: float) -> tuple[float, Interval, bool]:
    mean = float(other.mean() - one.mean())
    means = (
        bootstrapped_mean(other - one) if paired else bootstrapped_mean(other, sample=1).less(bootstrapped_mean(one))
    )
    return mean, means.interval(level), any(map(is_skewed, (other - one,) if paired else (one, other)))


def _unpaired_medians(one: FloatArray, other: FloatArray, level: float) -> Interval:
    """Of samples drawn independently; as many resamples as there are of the larger."""
    first, second = resampled_medians(one), resampled_medians(other, sample=1)
    fewer = min(len(first), len(second))
    return percentile_interval(second[:fewer] - first[:fewer], min(len(one), len(other)), level)


def _medians_of_times(one: Sample, other: Sample, paired: bool, level: float) -> tuple[float, Interval]:
    median = kaplan_meier(other).quantile(0.5) - kaplan_meier(one).quantile(0.5)
    first = resampled_quantiles(one, drawn(len(one)), 0.5)
    second = resampled_quantiles(other, drawn(len(other), 0 if paired else 1), 0.5)
    fewer = min(len(first), len(second))
    with np.errstate(invalid="ignore"):  # both beyond: it may be anything
        resampled = second[:fewer] - first[:fewer]
    unknown, n = np.isnan(resampled), min(len(one), len(other))
    low = percentile_interval(np.where(unknown, -np.inf, resampled), n, level).low
    return median, Interval(low, percentile_interval(np.where(unknown, np.inf, resampled), n, level).high)


def _p_of_numbers(one: FloatArray, other: FloatArray, paired: bool) -> tuple[float, Test]:
    scipy: Any = stats
    if not paired:
        return float(scipy.mannwhitneyu(one, other).pvalue), "Mann-Whitney"
    change = other - one
    return float(scipy.wilcoxon(change).pvalue) if change.any() else 1.0, "Wilcoxon signed-rank"
