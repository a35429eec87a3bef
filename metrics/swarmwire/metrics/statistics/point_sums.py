"""Sums per design point, of all runs or of resampled seeds: all that least squares needs of the runs."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.metrics.statistics.bootstrap import drawn


@dataclass(frozen=True)
class PointSums:
    """Of the values of each point, (points,); of resamples (resamples, points)."""

    count: FloatArray
    total: FloatArray
    squares: FloatArray


def point_sums(table: FloatArray) -> PointSums:
    """Of a table (points, seeds), NaN where a run has no value."""
    return _weighted(table, np.ones((1, table.shape[1])), 0)


def resampled_sums(table: FloatArray) -> PointSums:
    """The same of resamples of the seeds: a seed brings its runs of all points, or none."""
    return _weighted(table, drawn(table.shape[1]).astype(np.float64))


def _weighted(table: FloatArray, weight: FloatArray, row: int | slice = slice(None)) -> PointSums:
    there = np.isfinite(table)
    value = np.where(there, table, 0.0)
    count, total, squares = (weight @ of.T for of in (there.astype(np.float64), value, value**2))
    return PointSums(count[row], total[row], squares[row])
