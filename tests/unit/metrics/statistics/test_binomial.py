"""Wilson's interval, against scipy's."""

import numpy as np
from scipy.stats import binomtest

from swarmwire.metrics.statistics.binomial import binomial_interval


def test_intervals_are_those_of_scipy():
    cases = [(0, 1), (0, 20), (1, 3), (7, 10), (500, 1000), (12, 12)]
    for confidence in (0.5, 0.95, 0.99):
        low, high = binomial_interval(np.array([s for s, _ in cases]), np.array([n for _, n in cases]), confidence)
        for row, (successes, trials) in enumerate(cases):
            expected = binomtest(successes, trials).proportion_ci(confidence, method="wilson")
            np.testing.assert_allclose((low[row], high[row]), (expected.low, expected.high), atol=1e-12)


def test_without_a_trial_nothing_is_known():
    low, high = binomial_interval(np.array([0]), np.array([0]))
    assert np.isnan([low[0], high[0]]).all()
