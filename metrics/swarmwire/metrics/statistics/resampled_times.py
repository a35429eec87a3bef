"""Quantiles of censored times over many resamples at once."""

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.metrics.statistics.bootstrap import Counts
from swarmwire.metrics.statistics.kaplan_meier import ROUNDING
from swarmwire.metrics.statistics.sample import Sample


def resampled_quantiles(sample: Sample, drawn: Counts, share: float) -> FloatArray:
    """Kaplan and Meier's quantile of each resample, (resamples,); inf where it lies beyond what was watched.

    `drawn` (resamples, n) tells how often each value of the sample was drawn.
    """
    order = np.lexsort((~sample.observed, sample.value))  # at the same time events come before ends
    counts = drawn[:, order].astype(np.float64)
    at_risk = np.cumsum(counts[:, ::-1], axis=1)[:, ::-1]
    events = counts * sample.observed[order]
    survival = np.cumprod(1.0 - events / np.maximum(at_risk, 1.0), axis=1)
    reached = survival <= 1.0 - share + ROUNDING
    return np.where(reached.any(axis=1), sample.value[order][np.argmax(reached, axis=1)], np.inf)
