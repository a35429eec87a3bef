"""Times with right-censoring: the Kaplan-Meier estimate, the log-rank test, and Gehan's order of censored times.

S(t) = product over event times t_i <= t of (1 - d_i / n_i), of d_i events among the n_i runs that had neither had
theirs nor ended before t_i (Kaplan and Meier, J. Am. Stat. Assoc. 53, 1958). A run that ends at the time of an event
still counts among them.
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

ROUNDING = 1e-9  # a product of fractions that should be one half may come out a little above


@dataclass(frozen=True)
class KaplanMeier:
    """The estimate at each time at which something happened or ended, (k,), rising; before the first, S is 1."""

    time: FloatArray
    survival: FloatArray  # share to which it has not happened by then, that time included
    low: FloatArray  # of the pointwise band of confidence
    high: FloatArray
    variance: FloatArray  # Greenwood's sum over d / (n (n - d)) up to this time, inf from where S is 0
    level: float  # of the band

    def quantile(self, share: float) -> float:
        """The first time by which it has happened to this share of the runs; NaN: later than any was watched."""
        return self._first(self.survival, share)

    def quantile_interval(self, share: float) -> Interval:
        """Where the band meets the share (Brookmeyer and Crowley, Biometrics 38, 1982); high is inf where it does not.

        NaN of an empty sample, and low is NaN where not even the band's lower edge comes down to the share: the
        time is beyond the observed times.
        """
        if not len(self.time):
            return UNKNOWN
        high = self._first(self.high, share)
        return Interval(self._first(self.low, share), math.inf if math.isnan(high) else high)

    def restricted_mean(self, horizon: float) -> float:
        """The mean of min(time, horizon): the area under S up to there; beyond the last time S stays as it is."""
        return float(self._areas(horizon)[0]) if len(self.time) else math.nan

    def mean_terms(self, sample: Sample, horizon: float) -> FloatArray:
        """Terms (n,), one of each value of the sample, whose mean is the restricted mean.

        Without censoring these are min(value, horizon). Otherwise each is the restricted mean plus the influence of the
        value on it, so that the squares of their deviations add up to n² times Greenwood's variance (Klein and
        Moeschberger, 2003, section 4.5).
        """
        areas = self._areas(horizon)
        place = np.searchsorted(self.time, sample.value)
        events = np.bincount(place, sample.observed, minlength=len(self.time))
        at_risk = np.cumsum(np.bincount(place, minlength=len(self.time))[::-1])[::-1]
        stay = at_risk - events
        weight = np.where(stay > 0.0, len(sample) * areas[1:] / np.maximum(stay, 1.0), 0.0)
        expected = np.cumsum(weight * events / at_risk)
        return areas[0] + expected[place] - weight[place] * sample.observed

    def _first(self, curve: FloatArray, share: float) -> float:
        reached: BoolArray = curve <= 1.0 - share + ROUNDING
        return float(self.time[np.argmax(reached)]) if reached.any() else math.nan

    def _areas(self, horizon: float) -> FloatArray:
        """Area under S from 0, and from each time, to the horizon, (1 + k,)."""
        edges = np.minimum(np.concatenate([[0.0], self.time, [horizon]]), horizon)
        pieces = np.concatenate([[1.0], self.survival]) * np.diff(np.maximum.accumulate(edges))
        return np.cumsum(pieces[::-1])[::-1]


def kaplan_meier(sample: Sample, level: float = LEVEL) -> KaplanMeier:
    """The estimate of a sample, with the log-log band (Kalbfleisch and Prentice): S to the power exp(±z s / |ln S|).

    s is Greenwood's standard error of ln S. Where S is 0 the band reaches from 0 to where it reached before.
    """
    time, place = np.unique(sample.value, return_inverse=True)
    events = np.bincount(place, sample.observed, minlength=len(time))
    leave = np.bincount(place, minlength=len(time)).astype(np.float64)
    at_risk = np.cumsum(leave[::-1])[::-1]
    survival: FloatArray = np.multiply.accumulate(1.0 - events / at_risk)
    stay = at_risk - events
    variance = np.cumsum(np.where(stay > 0.0, events / (at_risk * np.maximum(stay, 1.0)), np.inf))
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


def resampled_quantiles(sample: Sample, drawn: Counts, share: float) -> FloatArray:
    """Kaplan and Meier's quantile of each resample, (resamples,); inf beyond the observed times.

    `drawn` (resamples, n) holds the number of draws of each value.
    """
    time, survival = _resampled(sample, drawn)
    reached = survival <= 1.0 - share + ROUNDING
    return np.where(reached.any(axis=1), time[np.argmax(reached, axis=1)], np.inf)


def resampled_restricted_means(sample: Sample, drawn: Counts, horizon: float) -> FloatArray:
    """The mean of min(time, horizon) of each resample, (resamples,): the area under its S up to there."""
    time, survival = _resampled(sample, drawn)
    edges = np.minimum(np.concatenate([[0.0], time, [horizon]]), horizon)
    pieces = np.diff(np.maximum.accumulate(edges))
    return pieces[0] + survival @ pieces[1:]


def _resampled(sample: Sample, drawn: Counts) -> tuple[FloatArray, FloatArray]:
    """All times (n,), rising, and S from each on in each resample, (resamples, n)."""
    order = np.lexsort((~sample.observed, sample.value))  # at the same time events come before ends
    counts = drawn[:, order].astype(np.float64)
    at_risk = np.cumsum(counts[:, ::-1], axis=1)[:, ::-1]
    events = counts * sample.observed[order]
    survival: FloatArray = np.multiply.accumulate(1.0 - events / np.maximum(at_risk, 1.0), axis=1)
    return sample.value[order], survival


def common_horizon(samples: Sequence[Sample]) -> float:
    """Up to when every run was observed: the first end of one that still waited; the last time if none did."""
    ends = np.concatenate([sample.value[~sample.observed] for sample in samples])
    return float(ends.min()) if len(ends) else max(float(sample.value.max()) for sample in samples)


class LogRank(NamedTuple):
    """The result of the test; NaN without an event while both samples had runs at risk."""

    z: float  # standard normal if both are alike; positive: it happens sooner in the first
    p: float  # two-sided


def log_rank(first: Sample, second: Sample) -> LogRank:
    """The test of two samples that are not paired, by scipy."""
    if not (len(first) and len(second)):
        return LogRank(math.nan, math.nan)
    with np.errstate(divide="ignore", invalid="ignore"):  # nothing happened while both had runs that waited
        found: Any = stats.logrank(_censored(first), _censored(second))
    return LogRank(float(found.statistic), float(found.pvalue))


def _censored(sample: Sample) -> Any:
    censored_data: Any = stats.CensoredData
    return censored_data.right_censored(sample.value, np.logical_not(sample.observed))


def surely_less(one: Sample, other: Sample) -> IntArray:
    """For each value of one (n,) how many of the other are surely less. Of numbers this is certain for all."""
    known = np.sort(other.value[other.observed])
    below = np.searchsorted(known, one.value, side="left")
    return np.where(one.observed, below, np.searchsorted(known, one.value, side="right")).astype(np.int64)


def surely_greater(one: Sample, other: Sample) -> IntArray:
    """For each value of one (n,) how many of the other are surely greater; none where it is censored itself."""
    known, waited = np.sort(other.value[other.observed]), np.sort(other.value[~other.observed])
    above = len(known) - np.searchsorted(known, one.value, side="right")
    after = len(waited) - np.searchsorted(waited, one.value, side="left")
    return np.where(one.observed, above + after, 0).astype(np.int64)


def paired_p(first: Sample, second: Sample) -> float:
    """The two-sided p-value of the paired Wilcoxon test for censored times (O'Brien and Fleming, Biometrics 43, 1987).

    Every time has a score, how many of all 2 n are surely less minus how many are surely greater. If the two of a pair
    were alike, the sum of differences d of their scores were normal with variance sum d². 1 if all d are 0.
    """
    one, other = (_scores(of, first, second) for of in (first, second))
    change = other - one
    squares = float(np.sum(change**2))
    return 2.0 * NormalDist().cdf(-abs(float(change.sum())) / math.sqrt(squares)) if squares > 0.0 else 1.0


def _scores(of: Sample, first: Sample, second: Sample) -> FloatArray:
    less, greater = (count(of, first) + count(of, second) for count in (surely_less, surely_greater))
    return (less - greater).astype(np.float64)
