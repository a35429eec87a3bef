"""Intervals: Wilson's against scipy's, and those of differences between series whose values depend on one another."""

import numpy as np
from scipy.stats import binomtest

from swarmwire.metrics.statistics.bootstrap import binomial_interval, block_means, mean_difference_interval


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


def sluggish(key: int, ticks: int = 1200, keeps: float = 0.9) -> np.ndarray:
    """A series that keeps nine tenths of what it was from tick to tick, with mean 0."""
    steps = np.random.default_rng(key).standard_normal(ticks)
    value = np.zeros(ticks)
    for tick in range(1, ticks):
        value[tick] = keeps * value[tick - 1] + steps[tick]
    return value


def test_blocks_are_of_equal_length_and_leave_the_start_out():
    assert block_means(np.arange(103.0)).tolist() == [7.5 + 10.0 * k for k in range(10)]
    assert len(block_means(np.arange(23.0))) == 4
    assert len(block_means(np.arange(4.0))) == 0


def test_equal_processes_are_told_apart_about_as_seldom_as_promised():
    """Of 100 pairs about 5 should be told apart: at most 13 (1 in 1000 were it 5 %). As if independent, half are."""
    apart = 0
    for pair in range(100):
        low, high = mean_difference_interval(sluggish(2 * pair), sluggish(2 * pair + 1))
        apart += not low <= 0.0 <= high
    assert apart <= 13


def test_a_real_difference_is_seen_with_its_sign():
    low, high = mean_difference_interval(sluggish(1), sluggish(2) + 5.0)
    assert 2.0 < low < 5.0 < high < 8.0


def test_series_too_short_for_blocks_have_no_interval():
    assert np.isnan(mean_difference_interval(np.ones(9), np.ones(100))).all()
