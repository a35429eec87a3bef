"""Samples of several design points side by side, seed by seed: for what is resampled over seeds."""

from collections.abc import Sequence

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.metrics.statistics.sample import Sample


def by_seed(samples: Sequence[Sample]) -> FloatArray:
    """The values of points and seeds, (points, seeds), seeds rising; NaN where a run has none.

    Of a time that was censored it is the time up to which it had not happened: where all runs may take equally long,
    means of these are restricted means.
    """
    seeds = np.unique(np.concatenate([sample.seed for sample in samples]))
    table = np.full((len(samples), len(seeds)), np.nan)
    for row, sample in zip(table, samples, strict=True):
        row[np.searchsorted(seeds, sample.seed)] = sample.value
    return table
