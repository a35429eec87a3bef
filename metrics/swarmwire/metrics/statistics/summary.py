"""Summary of a sample in numbers, and their texts: three digits, and `> 100` beyond the time limit."""

import math
from dataclasses import dataclass

import numpy as np

from swarmwire.metrics.statistics.bootstrap import (
    bootstrapped_mean,
    draw_counts_by_seed,
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
    """Summary of n values; NaN without values, and for a quartile beyond the observed times."""

    n: int
    seeds: int  #: number of seeds; less than n if several runs have the same seed
    failed: int  #: runs that ended in an error
    undefined: int  #: runs without an error and without a value
    censored: float  #: share of the values, 0 to 1; 0 for numbers
    stopped_first: int  #: runs that a stop condition ended before the time
    shortest: float  #: shortest censoring time of these runs; NaN without them
    q25: float
    q50: float
    q75: float
    mean: float  #: mean of min(time, limit) for times

    q50_interval: Interval
    mean_interval: Interval
    limit: float  #: the largest value; a quartile of times that is NaN lies beyond it
    is_skewed: bool  #: True if the interval of the mean may cover too little


def summary(sample: Sample, level: float = LEVEL) -> Summary:
    """Summarise a sample.

    Numbers have quantiles by linear interpolation (Hyndman and Fan's type 7) and bootstrap intervals of seeds. Times
    have Kaplan and Meier's quantiles with their intervals, and the mean restricted to the largest value with a
    bootstrap interval; if several runs have the same seed, the median has a bootstrap interval, too.
    """
    if not len(sample):
        nan = math.nan
        return Summary(
            0, 0, sample.failed, sample.undefined, nan, 0, nan, nan, nan, nan, nan, UNKNOWN, UNKNOWN, nan, False
        )
    return _time_summary(sample, level) if sample.kind == "time" else _number_summary(sample, level)


def _number_summary(sample: Sample, level: float) -> Summary:
    value, seeds = sample.value, sample.seeds
    q25, q50, q75 = (float(quantile) for quantile in np.quantile(value, (0.25, 0.5, 0.75)))
    return Summary(
        n=len(sample),
        seeds=seeds,
        failed=sample.failed,
        undefined=sample.undefined,
        censored=0.0,
        stopped_first=0,
        shortest=math.nan,
        q25=q25,
        q50=q50,
        q75=q75,
        mean=float(value.mean()),
        q50_interval=percentile_interval(resampled_medians(value, sample.seed), seeds, level),
        mean_interval=bootstrapped_mean(value, sample.seed).interval(level),
        limit=float(value.max()),
        is_skewed=is_skewed(value),
    )


def _time_summary(sample: Sample, level: float) -> Summary:
    curve, limit, stopped = kaplan_meier(sample, level), float(sample.value.max()), sample.stopped_first
    return Summary(
        n=len(sample),
        seeds=sample.seeds,
        failed=sample.failed,
        undefined=sample.undefined,
        censored=sample.censored,
        stopped_first=len(stopped),
        shortest=float(stopped.min()) if len(stopped) else math.nan,
        q25=curve.quantile(0.25),
        q50=curve.quantile(0.5),
        q75=curve.quantile(0.75),
        mean=curve.restricted_mean(limit),
        q50_interval=_median_interval(sample, curve, level),
        mean_interval=bootstrapped_mean(curve.mean_terms(sample, limit), sample.seed).interval(level),
        limit=limit,
        is_skewed=is_skewed(sample.value),
    )


def _median_interval(sample: Sample, curve: KaplanMeier, level: float) -> Interval:
    """Return the interval of a median time: the curve's, or the bootstrap's if runs share seeds."""
    if sample.seeds == len(sample):
        return curve.quantile_interval(0.5)
    counts, seeds = draw_counts_by_seed(sample.seed)
    low, high = percentile_interval(resampled_quantiles(sample, counts, 0.5), seeds, level)
    return Interval(math.nan if math.isinf(low) else low, high)


def quantile_text(value: float, limit: float) -> str:
    """Format a quantile of times; NaN lies beyond the limit.

    >>> quantile_text(42.0, 100.0), quantile_text(float("nan"), 100.0)
    ('42', '> 100')
    """
    return f"> {number_text(limit)}" if math.isnan(value) and not math.isnan(limit) else number_text(value)


def quartiles_text(summary: Summary) -> str:
    """Format the median and the quartiles: `12 (8 to > 100)`, or a dash without values."""
    q25, q50, q75 = (quantile_text(value, summary.limit) for value in (summary.q25, summary.q50, summary.q75))
    return f"{q50} ({q25} to {q75})" if summary.n else UNKNOWN_TEXT


def interval_text(interval: Interval, sign: bool = False) -> str:
    """Format an interval, which may be open.

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
