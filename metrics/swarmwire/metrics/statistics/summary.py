"""A sample in a few numbers, and these numbers as text: three digits, and `> 100` beyond the time limit."""

import math
from dataclasses import dataclass

import numpy as np

from swarmwire.metrics.statistics.bootstrap import (
    bootstrapped_mean,
    drawn_by_seed,
    is_skewed,
    percentile_interval,
    resampled_medians,
)
from swarmwire.metrics.statistics.sample import LEVEL, UNKNOWN, Interval, Sample
from swarmwire.metrics.statistics.survival import (
    KaplanMeier,
    kaplan_meier,
    resampled_quantiles,
)
from swarmwire.metrics.text import UNKNOWN_TEXT, number_text

SKEWED_SAMPLE = "skewed sample: the interval of the mean may cover less than it says"


@dataclass(frozen=True)
class Summary:
    """Of n values; NaN without values, and for a quartile of times beyond the observed times."""

    n: int
    seeds: int  # of these values: fewer than n if several runs have the same seed
    failed: int  # runs that ended in an error
    undefined: int  # runs that ended well with nothing to measure
    censored: float  # share of the values, 0 to 1; 0 for numbers
    stopped_first: int  # runs that a stop condition ended before the time, and so not by chance
    shortest: float  # observation of these runs; NaN of none
    q25: float
    q50: float
    q75: float
    mean: float  # of times: of min(time, limit)
    q50_interval: Interval
    mean_interval: Interval
    limit: float  # the largest value; a quartile of times that is NaN lies beyond it
    is_skewed: bool  # so that the interval of the mean may cover less than it says


def summary(sample: Sample, level: float = LEVEL) -> Summary:
    """Of numbers: quantiles by linear interpolation (Hyndman and Fan's type 7), intervals by the bootstrap of seeds.

    Of times: quantiles of Kaplan and Meier's estimate with their intervals, and the mean restricted to the largest
    value, with the bootstrap's; where several runs have the same seed, that of the median is the bootstrap's, too.
    """
    if not len(sample):
        nan = math.nan
        return Summary(
            0, 0, sample.failed, sample.undefined, nan, 0, nan, nan, nan, nan, nan, UNKNOWN, UNKNOWN, nan, False
        )
    describe = _times if sample.kind == "time" else _numbers
    return describe(sample, level)


def _numbers(sample: Sample, level: float) -> Summary:
    value, seeds = sample.value, sample.seeds
    q25, q50, q75 = (float(quantile) for quantile in np.quantile(value, (0.25, 0.5, 0.75)))
    median = percentile_interval(resampled_medians(value, sample.seed), seeds, level)
    mean = bootstrapped_mean(value, sample.seed).interval(level)
    counts = len(sample), seeds, sample.failed, sample.undefined
    numbers = q25, q50, q75, float(value.mean())
    return Summary(*counts, 0.0, 0, math.nan, *numbers, median, mean, float(value.max()), is_skewed(value))


def _times(sample: Sample, level: float) -> Summary:
    curve, limit = kaplan_meier(sample, level), float(sample.value.max())
    median, mean = _intervals_of_times(sample, curve, limit, level)
    return Summary(
        len(sample),
        sample.seeds,
        sample.failed,
        sample.undefined,
        sample.censored,
        len(sample.stopped_first),
        float(sample.stopped_first.min()) if len(sample.stopped_first) else math.nan,
        curve.quantile(0.25),
        curve.quantile(0.5),
        curve.quantile(0.75),
        curve.restricted_mean(limit),
        median,
        mean,
        limit,
        is_skewed(sample.value),
    )


def _intervals_of_times(sample: Sample, curve: KaplanMeier, limit: float, level: float) -> tuple[Interval, Interval]:
    """Of the median and of the restricted mean."""
    mean = bootstrapped_mean(curve.mean_terms(sample, limit), sample.seed).interval(level)
    if sample.seeds == len(sample):
        return curve.quantile_interval(0.5), mean
    counts, seeds = drawn_by_seed(sample.seed)
    low, high = percentile_interval(resampled_quantiles(sample, counts, 0.5), seeds, level)
    return Interval(math.nan if math.isinf(low) else low, high), mean


def quantile_text(value: float, limit: float) -> str:
    """A quantile of times; NaN lies beyond the limit.

    >>> quantile_text(42.0, 100.0), quantile_text(float("nan"), 100.0)
    ('42', '> 100')
    """
    return f"> {number_text(limit)}" if math.isnan(value) and not math.isnan(limit) else number_text(value)


def quartiles_text(of: Summary) -> str:
    """The median, and the quartiles around it.

    `12 (8 to > 100)`, or a dash of no values.
    """
    q25, q50, q75 = (quantile_text(value, of.limit) for value in (of.q25, of.q50, of.q75))
    return f"{q50} ({q25} to {q75})" if of.n else UNKNOWN_TEXT


def interval_text(interval: Interval, sign: bool = False) -> str:
    """An interval, which may be open.

    >>> interval_text(Interval(1.0, 2.0)), interval_text(Interval(3.0, float("inf")))
    ('1 to 2', '3 or more')
    >>> interval_text(Interval(-float("inf"), 2.0), sign=True)
    '+2 or less'
    """
    low, high = interval
    if math.isnan(low) or math.isnan(high) or (math.isinf(low) and math.isinf(high)):
        return UNKNOWN_TEXT
    if math.isinf(high):
        return f"{number_text(low, sign)} or more"
    if math.isinf(low):
        return f"{number_text(high, sign)} or less"
    return f"{number_text(low, sign)} to {number_text(high, sign)}"
