"""Whether two samples of times differ, censored or not: the log-rank test (Mantel, Cancer Chemother. Rep. 50, 1966)."""

import math
from typing import Any, NamedTuple

import numpy as np
from scipy import stats

from swarmwire.metrics.statistics.sample import Sample


class LogRank(NamedTuple):
    """The test's result; NaN if nothing tells the two apart: nothing happened, or not to both."""

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
