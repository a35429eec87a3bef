"""How far apart two distributions are, by a sample of each.

Values of one series of ticks are not independent: these distances tell how far apart the samples lie, and no more. Who
asks whether that is more than chance compares them with those between runs.
"""

import numpy as np

from swarmwire.comms.arrays import FloatArray


def kolmogorov_smirnov(a: FloatArray, b: FloatArray) -> float:
    """The largest difference of the shares of (n,) and of (m,) finite values up to any value, 0 to 1; NaN of nothing.

    Source: N. Smirnov, Table for estimating the goodness of fit of empirical distributions, Ann. Math. Statist. 19
    (1948).
    """
    if not (len(a) and len(b)):
        return float("nan")
    _, below_a, below_b = _shares(a, b)
    return float(np.abs(below_a - below_b).max())


def wasserstein_1(a: FloatArray, b: FloatArray) -> float:
    """How far the values of (n,) must move on average to be those of (m,), in their unit; NaN of nothing.

    The area between the two distribution functions. Source: C. Villani, Optimal Transport (2009), chapter 6.
    """
    if not (len(a) and len(b)):
        return float("nan")
    value, below_a, below_b = _shares(a, b)
    return float((np.abs(below_a - below_b)[:-1] * np.diff(value)).sum())


def _shares(a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """All values in rising order, and which shares of each sample are up to there."""
    value = np.sort(np.concatenate([a, b]))
    below = [np.searchsorted(np.sort(of), value, "right") / len(of) for of in (a, b)]
    return value, below[0], below[1]
