"""The order of times of which some are censored: surely before, surely after, or unknown (Gehan, Biometrika 52, 1965).

A time that is censored is surely after all that were observed up to then, that very time included.
"""

import math
from statistics import NormalDist

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.metrics.statistics.sample import Sample


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
    were alike, the sum of differences d of their scores were normal with variance sum d². NaN if no order is known.
    """
    one, other = (_scores(of, first, second) for of in (first, second))
    change = other - one
    squares = float(np.sum(change**2))
    return 2.0 * NormalDist().cdf(-abs(float(change.sum())) / math.sqrt(squares)) if squares > 0.0 else math.nan


def _scores(of: Sample, first: Sample, second: Sample) -> FloatArray:
    less, greater = (count(of, first) + count(of, second) for count in (surely_less, surely_greater))
    return (less - greater).astype(np.float64)
