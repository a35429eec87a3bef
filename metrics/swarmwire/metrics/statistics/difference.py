"""Difference of two samples: its size with an interval, a test, and effect sizes.

If two seeds or more are in both samples, these are compared seed by seed: runs of one seed start alike, so their
differences vary less. Otherwise the samples are compared without pairs. Failed runs do not count.
"""

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from scipy import stats

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.metrics.statistics.bootstrap import (
    bootstrapped_mean,
    draw_counts,
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
MAX_DISCRETE = 10  # distinct values of a discrete outcome, over both samples


def cliffs_delta(first: Sample, second: Sample) -> float:
    """Return P(first > second) - P(first < second) over all pairs, -1 to 1 (Cliff, Psychol. Bull. 114, 1993).

    NaN without pairs. The value is 2 A - 1 with A of Vargha and Delaney (2000). Pairs of censored times whose order is
    unknown count as equal (Gehan, Biometrika 52, 1965), which biases the value towards 0.
    """
    pairs = len(first) * len(second)
    if not pairs:
        return math.nan
    return float(surely_less(first, second).sum() - surely_less(second, first).sum()) / pairs


def hedges_g(first: FloatArray, second: FloatArray) -> float:
    """Return (mean of first (n,) - mean of second (m,)) / pooled standard deviation, unbiased; NaN without variance.

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
    """Return the largest difference of the distribution functions of finite values (n,) and (m,); NaN without values.

    Source: N. Smirnov, Table for estimating the goodness of fit of empirical distributions, Ann. Math. Statist. 19
    (1948).
    """
    if not (len(a) and len(b)):
        return float("nan")
    _, below_a, below_b = _shares(a, b)
    return float(np.abs(below_a - below_b).max())


def wasserstein_1(a: FloatArray, b: FloatArray) -> float:
    """Return the area between the distribution functions of values (n,) and (m,), in their unit; NaN without values.

    This is the mean distance by which values must move to turn one sample into the other. Source: C. Villani, Optimal
    Transport (2009), chapter 6.
    """
    if not (len(a) and len(b)):
        return float("nan")
    value, below_a, below_b = _shares(a, b)
    return float((np.abs(below_a - below_b)[:-1] * np.diff(value)).sum())


def _shares(a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return all values, sorted, and the distribution function of each sample at these values."""
    value = np.sort(np.concatenate([a, b]))
    below_a, below_b = (np.searchsorted(np.sort(sample), value, "right") / len(sample) for sample in (a, b))
    return value, below_a, below_b


@dataclass(frozen=True)
class Difference:
    """Second minus first; NaN: unknown."""

    pairs: int  #: seeds that were compared one by one; 0: no pairs
    median: float  #: median of the differences for numbers in pairs, else difference of the medians
    median_interval: Interval  #: bootstrap; open if resampled medians of times lie beyond the observed times
    mean: float  #: difference of the means; for times, of min(time, horizon)
    mean_interval: Interval  #: bootstrap
    is_skewed: bool  #: True if the differences, or a sample, are skewed: the interval of the mean may cover too little
    horizon: float  #: time up to which every run was observed; inf for numbers
    is_discrete: bool  #: True for numbers of few distinct values: medians hardly differ, the mean is more informative
    delta: float  #: Cliff's, -1 to 1: P(second > first) - P(second < first), over all values
    g: float  #: Hedges'; NaN for times
    p: float  #: two-sided; NaN: not defined
    test: Test


def difference(first: Sample, second: Sample, level: float = LEVEL) -> Difference:
    """Compare two samples of one kind."""
    seeds = np.intersect1d(first.seed, second.seed)
    paired = len(seeds) >= MIN_PAIRS
    a, b = (first.select_seeds(seeds), second.select_seeds(seeds)) if paired else (first, second)
    is_time = first.kind == "time"
    if not (len(a) and len(b)):
        test: Test = "log-rank" if is_time else "Mann-Whitney"
        nan = math.nan
        return Difference(0, nan, UNKNOWN, nan, UNKNOWN, False, math.inf, False, nan, nan, nan, test)
    if is_time:
        horizon, is_discrete, g = common_horizon([a, b]), False, math.nan
        p, test = (paired_p(a, b), "paired Gehan") if paired else (log_rank(a, b).p, "log-rank")
        median, median_interval = _time_medians(a, b, paired, level)
    else:
        horizon, is_discrete, g = math.inf, _is_discrete(a.value, b.value), hedges_g(second.value, first.value)
        p, test = _number_test(a.value, b.value, paired)
        median, median_interval = _number_medians(a.value, b.value, paired, level)
    mean, mean_interval, skewed = _means(np.minimum(a.value, horizon), np.minimum(b.value, horizon), paired, level)
    return Difference(
        pairs=len(seeds) if paired else 0,
        median=median,
        median_interval=median_interval,
        mean=mean,
        mean_interval=mean_interval,
        is_skewed=skewed,
        horizon=horizon,
        is_discrete=is_discrete,
        delta=cliffs_delta(second, first),
        g=g,
        p=p,
        test=test,
    )


def _is_discrete(a: FloatArray, b: FloatArray) -> bool:
    """Return True for few distinct values that occur more than once on average."""
    distinct = len(np.unique(np.concatenate([a, b])))
    return distinct <= min(MAX_DISCRETE, (len(a) + len(b)) // 2)


def _number_medians(a: FloatArray, b: FloatArray, paired: bool, level: float) -> tuple[float, Interval]:
    if paired:
        resampled = resampled_medians(b - a)
        return float(np.median(b - a)), percentile_interval(resampled, len(a), level)
    return float(np.median(b) - np.median(a)), _unpaired_medians(a, b, level)


def _means(a: FloatArray, b: FloatArray, paired: bool, level: float) -> tuple[float, Interval, bool]:
    """Return the difference of the means, its interval, and True if the interval is that of a skewed sample."""
    mean = float(b.mean() - a.mean())
    means = bootstrapped_mean(b - a) if paired else bootstrapped_mean(b, sample=1).minus(bootstrapped_mean(a))
    return mean, means.interval(level), any(map(is_skewed, (b - a,) if paired else (a, b)))


def _unpaired_medians(a: FloatArray, b: FloatArray, level: float) -> Interval:
    """Return the interval of the difference of medians for independent samples, with the resamples of the larger."""
    first, second = resampled_medians(a), resampled_medians(b, sample=1)
    resamples = min(len(first), len(second))
    return percentile_interval(second[:resamples] - first[:resamples], min(len(a), len(b)), level)


def _time_medians(a: Sample, b: Sample, paired: bool, level: float) -> tuple[float, Interval]:
    median = kaplan_meier(b).quantile(0.5) - kaplan_meier(a).quantile(0.5)
    first = resampled_quantiles(a, draw_counts(len(a)), 0.5)
    second = resampled_quantiles(b, draw_counts(len(b), 0 if paired else 1), 0.5)
    resamples = min(len(first), len(second))
    with np.errstate(invalid="ignore"):  # if both medians are beyond the observed times, the difference is unknown
        resampled = second[:resamples] - first[:resamples]
    unknown, n = np.isnan(resampled), min(len(a), len(b))
    low = percentile_interval(np.where(unknown, -np.inf, resampled), n, level).low
    return median, Interval(low, percentile_interval(np.where(unknown, np.inf, resampled), n, level).high)


def _number_test(a: FloatArray, b: FloatArray, paired: bool) -> tuple[float, Test]:
    scipy: Any = stats
    if not paired:
        return float(scipy.mannwhitneyu(a, b).pvalue), "Mann-Whitney"
    change = b - a
    return float(scipy.wilcoxon(change).pvalue) if change.any() else 1.0, "Wilcoxon signed-rank"
