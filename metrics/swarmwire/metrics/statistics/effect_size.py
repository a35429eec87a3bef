"""How far apart two samples are, whatever their units."""

import math

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.metrics.statistics.gehan import surely_less
from swarmwire.metrics.statistics.sample import Sample


def cliffs_delta(first: Sample, second: Sample) -> float:
    """P(first > second) - P(first < second) over all pairs, -1 to 1 (Cliff, Psychol. Bull. 114, 1993); NaN of none.

    It is 2 A - 1 with A of Vargha and Delaney (2000). Of censored times, pairs whose order is unknown count as equal
    (Gehan, Biometrika 52, 1965): so it errs towards 0.
    """
    pairs = len(first) * len(second)
    if not pairs:
        return math.nan
    return float(surely_less(first, second).sum() - surely_less(second, first).sum()) / pairs


def hedges_g(first: FloatArray, second: FloatArray) -> float:
    """(mean of first (n,) - mean of second (m,)) / pooled standard deviation, unbiased; NaN where there is none.

    The factor 1 - 3 / (4 (n + m) - 9) takes off what small samples add (Hedges, J. Educ. Stat. 6, 1981).
    """
    freedom = len(first) + len(second) - 2
    if min(len(first), len(second)) < 1 or freedom < 1:
        return math.nan
    squares = float(np.sum((first - first.mean()) ** 2) + np.sum((second - second.mean()) ** 2))
    if squares <= 0.0:
        return math.nan
    return float(first.mean() - second.mean()) / math.sqrt(squares / freedom) * (1.0 - 3.0 / (4.0 * freedom - 1.0))
