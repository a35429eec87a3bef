"""Published samples, and strategies for made-up ones."""

import numpy as np
from hypothesis import strategies as st

from swarmwire.metrics.statistics.sample import Sample, number_sample, time_sample

# Weeks in remission of leukaemia (Freireich et al., Blood 21, 1963), as every textbook on survival has them.
TREATED = [6, 6, 6, 6, 7, 9, 10, 10, 11, 13, 16, 17, 19, 20, 22, 23, 25, 32, 32, 34, 35]
TREATED_RELAPSED = [1, 1, 1, 0, 1, 0, 1, 0, 0, 1, 1, 0, 0, 0, 1, 1, 0, 0, 0, 0, 0]
PLACEBO = [1, 1, 2, 2, 3, 4, 4, 5, 5, 8, 8, 8, 8, 11, 11, 12, 12, 15, 17, 22, 23]


def times(value, observed=None) -> Sample:
    """A sample of times; all observed unless told."""
    value = np.asarray(value, np.float64)
    return time_sample(value, np.ones(len(value), np.bool_) if observed is None else np.asarray(observed, np.bool_))


def numbers(value, seed=None) -> Sample:
    """A sample of numbers."""
    return number_sample(np.asarray(value, np.float64), None if seed is None else np.asarray(seed, np.int64))


def treated() -> Sample:
    return times(TREATED, TREATED_RELAPSED)


def placebo() -> Sample:
    return times(PLACEBO)


whole_numbers = st.integers(-20, 20).map(float)  # small and whole, so that there are ties
number_samples = st.lists(whole_numbers, min_size=1, max_size=30).map(numbers)
time_samples = st.lists(st.tuples(st.integers(0, 12).map(float), st.booleans()), min_size=1, max_size=30).map(
    lambda pairs: times([time for time, _ in pairs], [happened for _, happened in pairs])
)
