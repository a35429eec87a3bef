"""Times with right-censoring: the Kaplan-Meier estimate, the log-rank test, and Gehan's order of censored times.

S(t) = product over event times t_i <= t of (1 - d_i / n_i), with d_i events among the n_i runs at risk: those without
an event and without an end before t_i (Kaplan and Meier, J. Am. Stat. Assoc. 53, 1958). A run that ends at the time of
an event is still at risk.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np
from scipy import stats

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.metrics.statistics.bootstrap import Counts
from swarmwire.metrics.statistics.sample import LEVEL, UNKNOWN, Interval, Sample

ROUNDING = 1e-9  # a product of fractions that equals one half may be rounded up


@dataclass(frozen=True)
class KaplanMeier:
    """The estimate at each time of an event or an end, (k,), sorted; before the first time, S is 1."""

    time: FloatArray
    survival: FloatArray  #: share of the runs without an event up to this time, inclusive
    low: FloatArray  #: lower edge of the pointwise confidence band
    high: FloatArray
    variance: FloatArray  #: Greenwood's sum over d / (n (n - d)) up to this time, inf once S is 0
    level: float  #: confidence level of the band

    def quantile(self, share: float) -> float:
        """Return the first time by which this share of the runs had the event; NaN: beyond the observed times."""
        return self._first(self.survival, share)

    def quantile_interval(self, share: float) -> Interval:
        """Return the times at which the band's edges reach the share (Brookmeyer and Crowley, Biometrics 38, 1982).

        High is inf if the upper edge does not reach it. Low is NaN if not even the lower edge reaches it: the time is
        beyond the observed times. Both are NaN for an empty sample.
        """
        if not len(self.time):
            return UNKNOWN
        high = self._first(self.high, share)
        return Interval(self._first(self.low, share), math.inf if math.isnan(high) else high)

    def restricted_mean(self, horizon: float) -> float:
        """Return the mean of min(time, horizon), the area under S up to the horizon; S is constant after its end."""
        return float(self._areas(horizon)[0]) if len(self.time) else math.nan

    def mean_terms(self, sample: Sample, horizon: float) -> FloatArray:
        """Return a term for each value of the sample, (n,), whose mean is the restricted mean.

        Without censoring a term is min(value, horizon). With censoring it is the restricted mean plus the influence of
        the value on it, so that the squares of their deviations add up to n² times Greenwood's variance (Klein and
        Moeschberger, 2003, section 4.5).
        """
        areas = self._areas(horizon)
        index = np.searchsorted(self.time, sample.value)
        events = np.bincount(index, sample.observed, minlength=len(self.time))
        at_risk = np.cumsum(np.bincount(index, minlength=len(self.time))[::-1])[::-1]
        survivors = at_risk - events
        weight = np.where(survivors > 0.0, len(sample) * areas[1:] / np.maximum(survivors, 1.0), 0.0)
        expected = np.cumsum(weight * events / at_risk)
        return areas[0] + expected[index] - weight[index] * sample.observed

    def _first(self, curve: FloatArray, share: float) -> float:
        reached: BoolArray = curve <= 1.0 - share + ROUNDING
        return float(self.time[np.argmax(reached)]) if reached.any() else math.nan

    def _areas(self, horizon: float) -> FloatArray:
        """Return the area under S from 0, and from each time, to the horizon, (1 + k,)."""
        edges = np.minimum(np.concatenate([[0.0], self.time, [horizon]]), horizon)
        areas = np.concatenate([[1.0], self.survival]) * np.diff(np.maximum.accumulate(edges))
        return np.cumsum(areas[::-1])[::-1]


def kaplan_meier(sample: Sample, level: float = LEVEL) -> KaplanMeier:
    """Estimate S of a sample, with the log-log band (Kalbfleisch and Prentice): S to the power exp(±z s / |ln S|).

    s is Greenwood's standard error of ln S. Where S is 0 the band reaches from 0 to its last upper edge before.
    """
    time, index = np.unique(sample.value, return_inverse=True)
    events = np.bincount(index, sample.observed, minlength=len(time))
    leaving = np.bincount(index, minlength=len(time)).astype(np.float64)
    at_risk = np.cumsum(leaving[::-1])[::-1]
    survival: FloatArray = np.multiply.accumulate(1.0 - events / at_risk)
    survivors = at_risk - events
    variance = np.cumsum(np.where(survivors > 0.0, events / (at_risk * np.maximum(survivors, 1.0)), np.inf))
    low, high = _band(survival, variance, level)
    return KaplanMeier(time, survival, low, high, variance, level)


def _band(survival: FloatArray, variance: FloatArray, level: float) -> tuple[FloatArray, FloatArray]:
    inner = (survival > 0.0) & (survival < 1.0)
    low, high = survival.copy(), survival.copy()
    z = NormalDist().inv_cdf(0.5 + 0.5 * level)
    power = np.exp(z * np.sqrt(variance[inner]) / -np.log(survival[inner]))
    low[inner], high[inner] = survival[inner] ** power, survival[inner] ** (1.0 / power)
    high[survival == 0.0] = high[inner][-1] if inner.any() else 1.0
    return low, high


def resampled_quantiles(sample: Sample, counts: Counts, share: float) -> FloatArray:
    """Return Kaplan and Meier's quantile of each resample, (resamples,); inf beyond the observed times.

    `counts` (resamples, n) is the number of draws of each value.
    """
    time, survival = _resampled(sample, counts)
    reached = survival <= 1.0 - share + ROUNDING
    return np.where(reached.any(axis=1), time[np.argmax(reached, axis=1)], np.inf)


def resampled_restricted_means(sample: Sample, counts: Counts, horizon: float) -> FloatArray:
    """Return the mean of min(time, horizon) of each resample, (resamples,), the area under its S up to the horizon."""
    time, survival = _resampled(sample, counts)
    edges = np.minimum(np.concatenate([[0.0], time, [horizon]]), horizon)
    widths = np.diff(np.maximum.accumulate(edges))
    return widths[0] + survival @ widths[1:]


def _resampled(sample: Sample, counts: Counts) -> tuple[FloatArray, FloatArray]:
    """Return all times (n,), sorted, and S from each time on in each resample, (resamples, n)."""
    order = np.lexsort((~sample.observed, sample.value))  # events come before ends at the same time
    weight = counts[:, order].astype(np.float64)
    at_risk = np.cumsum(weight[:, ::-1], axis=1)[:, ::-1]
    events = weight * sample.observed[order]
    survival: FloatArray = np.multiply.accumulate(1.0 - events / np.maximum(at_risk, 1.0), axis=1)
    return sample.value[order], survival


def common_horizon(samples: Sequence[Sample]) -> float:
    """Return the time up to which every run was observed: the first censoring time, or the last time without one."""
    ends = np.concatenate([sample.value[~sample.observed] for sample in samples])
    return float(ends.min()) if len(ends) else max(float(sample.value.max()) for sample in samples)


class LogRank(NamedTuple):
    """The result of the test; NaN without an event while both samples had runs at risk."""

    z: float  #: standard normal under the null hypothesis; positive: earlier events in the first sample
    p: float  #: two-sided


def log_rank(first: Sample, second: Sample) -> LogRank:
    """Test two samples that are not paired, by scipy."""
    if not (len(first) and len(second)):
        return LogRank(math.nan, math.nan)
    with np.errstate(divide="ignore", invalid="ignore"):  # no event while both samples had runs at risk
        result: Any = stats.logrank(_censored(first), _censored(second))
    return LogRank(float(result.statistic), float(result.pvalue))


def _censored(sample: Sample) -> Any:
    censored_data: Any = stats.CensoredData
    return censored_data.right_censored(sample.value, np.logical_not(sample.observed))


def surely_less(sample: Sample, other: Sample) -> IntArray:
    """Count, for each value of `sample` (n,), the values of `other` that are surely less; numbers are all certain."""
    observed = np.sort(other.value[other.observed])
    below = np.searchsorted(observed, sample.value, side="left")
    return np.where(sample.observed, below, np.searchsorted(observed, sample.value, side="right")).astype(np.int64)


def surely_greater(sample: Sample, other: Sample) -> IntArray:
    """Count, for each value of `sample` (n,), the values of `other` that are surely greater; 0 if it is censored."""
    observed, censored = np.sort(other.value[other.observed]), np.sort(other.value[~other.observed])
    above = len(observed) - np.searchsorted(observed, sample.value, side="right")
    after = len(censored) - np.searchsorted(censored, sample.value, side="left")
    return np.where(sample.observed, above + after, 0).astype(np.int64)


def paired_p(first: Sample, second: Sample) -> float:
    """Return the two-sided p of the paired Wilcoxon test for censored times (O'Brien and Fleming, Biometrics 43, 1987).

    The score of a time is the number of all 2 n times that are surely less minus the number that are surely greater.
    Under the null hypothesis the sum of the pairs' differences d is normal with variance sum d². 1 if all d are 0.
    """
    change = _scores(second, first, second) - _scores(first, first, second)
    squares = float(np.sum(change**2))
    return 2.0 * NormalDist().cdf(-abs(float(change.sum())) / math.sqrt(squares)) if squares > 0.0 else 1.0


def _scores(sample: Sample, first: Sample, second: Sample) -> FloatArray:
    less, greater = (count(sample, first) + count(sample, second) for count in (surely_less, surely_greater))
    return (less - greater).astype(np.float64)
