"""Whether two ways of doing the same thing differ on average over the same seeds."""

import numpy as np
from scipy import stats

FALSE_ALARM = 1e-4  # of one comparison, if both did the same


def assert_same_on_average(what: str, one: np.ndarray, other: np.ndarray, margin: float = 0.0) -> None:
    """A paired t test of values (seeds,): the same seed has the same start and obstacles in both.

    What differs on average by no more than `margin`, a share, counts as the same.
    """
    apart = one - other
    error = apart.std(ddof=1) / np.sqrt(len(apart))
    most = stats.t.ppf(1.0 - 0.5 * FALSE_ALARM, len(apart) - 1) * error
    print(f"{what}: {one.mean():.4g} and {other.mean():.4g}, standard error of the difference {error:.2g}")
    assert abs(apart.mean()) <= most + max(margin, 1e-12) * abs(other.mean()), what
