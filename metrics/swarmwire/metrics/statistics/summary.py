"""A sample in a few numbers."""

import math
from dataclasses import dataclass

import numpy as np

from swarmwire.metrics.statistics.bootstrap import percentile_interval, resampled_means, resampled_medians
from swarmwire.metrics.statistics.interval import LEVEL, UNKNOWN, Interval
from swarmwire.metrics.statistics.kaplan_meier import kaplan_meier
from swarmwire.metrics.statistics.sample import Sample


@dataclass(frozen=True)
class Summary:
    """Of n values; NaN where there are none, and for a quartile of times that lies beyond what was watched."""

    n: int
    failed: int  # runs that ended in an error
    undefined: int  # runs that ended well with nothing to measure
    censored: float  # share of the values, 0 to 1; 0 for numbers
    q25: float
    q50: float
    q75: float
    mean: float  # of times: of min(time, limit)
    q50_interval: Interval
    mean_interval: Interval
    limit: float  # the largest value; of times, what a quartile that is NaN lies beyond


def summary(sample: Sample, level: float = LEVEL) -> Summary:
    """Of numbers: quantiles by linear interpolation (Hyndman and Fan's type 7), intervals by the bootstrap.

    Of times: quantiles of Kaplan and Meier's estimate with their intervals, and the mean restricted to the largest
    value, with Greenwood's.
    """
    if not len(sample):
        nan = math.nan
        return Summary(0, sample.failed, sample.undefined, nan, nan, nan, nan, nan, UNKNOWN, UNKNOWN, nan)
    describe = _times if sample.kind == "time" else _numbers
    return describe(sample, level)


def _numbers(sample: Sample, level: float) -> Summary:
    value, n = sample.value, len(sample)
    q25, q50, q75 = (float(quantile) for quantile in np.quantile(value, (0.25, 0.5, 0.75)))
    median = percentile_interval(resampled_medians(value), n, level)
    mean = percentile_interval(resampled_means(value), n, level)
    return Summary(
        n, sample.failed, sample.undefined, 0.0, q25, q50, q75, float(value.mean()), median, mean, float(value.max())
    )


def _times(sample: Sample, level: float) -> Summary:
    curve, limit = kaplan_meier(sample, level), float(sample.value.max())
    return Summary(
        len(sample),
        sample.failed,
        sample.undefined,
        sample.censored,
        curve.quantile(0.25),
        curve.quantile(0.5),
        curve.quantile(0.75),
        curve.restricted_mean(limit),
        curve.quantile_interval(0.5),
        curve.restricted_mean_interval(limit),
        limit,
    )
