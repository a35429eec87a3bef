"""A sample in a few numbers, with intervals that cover what they say, and as people read it."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binomtest

from swarmwire.metrics.statistics.bootstrap import (
    binomial_interval,
    block_means,
    bootstrapped_mean,
    draw_counts,
    draw_counts_by_seed,
    mean_difference_interval,
    percentile_interval,
    resampled_medians,
)
from swarmwire.metrics.statistics.sample import UNKNOWN, Interval
from swarmwire.metrics.statistics.summary import interval_text, quartiles_text, summary
from swarmwire.metrics.text import number_text
from tests.support.metrics.samples import number_samples, numbers, placebo, times, treated


def test_quartiles_and_mean_of_numbers_are_numpys():
    result = summary(numbers([1.0, 2.0, 4.0, 10.0, np.nan]))
    assert (result.n, result.undefined, result.censored) == (4, 1, 0.0)
    assert (result.q25, result.q50, result.q75, result.mean) == (1.75, 3.0, 5.5, 4.25)


def test_times_have_quartiles_of_survival_and_those_beyond_the_limit_are_none():
    result = summary(treated())
    assert (result.n, result.q25, result.q50, result.limit) == (21, 13.0, 23.0, 35.0)
    assert result.censored == pytest.approx(12 / 21)
    assert math.isnan(result.q75)
    assert result.q50_interval == (13.0, math.inf)
    assert summary(placebo()).mean == pytest.approx(182 / 21)


@pytest.mark.parametrize("sample", [numbers([]), times([])])
def test_summary_of_an_empty_sample_is_nan(sample):
    result = summary(sample)
    assert result.n == 0
    assert all(math.isnan(value) for value in (result.q50, result.mean, result.censored, *result.mean_interval))


def test_summary_of_one_value_has_no_interval():
    result = summary(numbers([3.0]))
    assert (result.q25, result.q50, result.mean) == (3.0, 3.0, 3.0)
    assert all(math.isnan(end) for end in (*result.q50_interval, *result.mean_interval))


@given(number_samples)
def test_summary_does_not_depend_on_the_order_of_values(sample):
    once, again, turned = summary(sample), summary(sample), summary(numbers(sample.value[::-1]))
    assert repr(once) == repr(again)
    assert (once.q25, once.q50, once.q50_interval) == (turned.q25, turned.q50, turned.q50_interval)


@pytest.mark.parametrize("n", [2, 3, 10, 51])
def test_resamples_draw_n_values_and_each_about_equally_often(n):
    """A value's mean over 2000 resamples has a standard error of 0.022; five of them fail once in 1e5 lists."""
    counts = draw_counts(n)
    assert (counts.sum(axis=1) == n).all()
    assert np.abs(counts.mean(axis=0) - 1.0).max() < 0.115
    assert not np.array_equal(counts, draw_counts(n, 1))


@given(st.lists(st.floats(-5.0, 5.0), min_size=1, max_size=12))
def test_means_and_medians_of_resamples_are_those_of_the_values_drawn(values):
    value = np.array(values)
    means, medians = bootstrapped_mean(value).resampled, resampled_medians(value)
    for resample in range(5):
        # The n-th place of a median is that in rising order: each resample of places is a resample of values.
        counts = draw_counts(len(value))[resample].astype(np.int64)
        assert means[resample] == pytest.approx(np.repeat(value, counts).mean(), abs=1e-6)
        assert medians[resample] == pytest.approx(np.median(np.repeat(np.sort(value), counts)))


@given(st.lists(st.tuples(st.floats(-5.0, 5.0), st.integers(0, 3)), min_size=2, max_size=12))
def test_whole_seeds_are_resampled(rows):
    value, seed = np.array([row[0] for row in rows]), np.array([row[1] for row in rows])
    counts, seeds = draw_counts_by_seed(seed)
    means, medians = bootstrapped_mean(value, seed).resampled, resampled_medians(value, seed)
    assert seeds == len(set(seed.tolist()))
    for resample in range(5):
        # Where each value has a seed of its own, the n-th count of a median is that of the n-th in rising order.
        often, drawn = counts[resample].astype(int), np.sort(value) if seeds == len(value) else value
        assert all(len(set(often[seed == one].tolist())) == 1 for one in seed)
        assert means[resample] == pytest.approx(np.repeat(value, often).mean(), abs=1e-6)
        assert medians[resample] == pytest.approx(np.median(np.repeat(drawn, often)))


def tiled(sample, copies):
    columns = {name: np.tile(getattr(sample, name), copies) for name in ("value", "observed", "seed")}
    return replace(sample, **columns)


def test_runs_of_one_seed_tell_no_more_than_one_of_them():
    """Points of equal values: pooled over five of them the interval is that of one."""
    sample = numbers([3.0, 1.0, 4.0, 1.5, 9.0, 2.0, 6.0, 5.0])
    one, three, five = (summary(tiled(sample, copies)) for copies in (1, 3, 5))
    assert (five.n, five.seeds) == (40, 8)
    assert five.mean_interval == pytest.approx(one.mean_interval, rel=1e-6)
    assert five.q50_interval == three.q50_interval
    assert five.q50_interval.low < five.q50 < five.q50_interval.high


def test_times_of_one_seed_tell_no_more_than_one_of_them():
    sample = times([3.0, 1.0, 4.0, 10.0, 9.0, 10.0], [True, True, True, False, True, False])
    two, four = summary(tiled(sample, 2)), summary(tiled(sample, 4))
    assert two.q50_interval == four.q50_interval
    assert two.mean_interval == pytest.approx(four.mean_interval, rel=1e-6)
    assert two.mean_interval.low < two.mean < two.mean_interval.high


def test_interval_with_infinite_values_is_open_and_with_nan_unknown():
    resampled = np.array([1.0] * 50 + [math.inf] * 50)
    assert percentile_interval(resampled, 30) == (1.0, math.inf)
    assert math.isnan(percentile_interval(np.array([1.0, math.nan]), 30).low)


@pytest.mark.parametrize("n", [8, 30])
def test_intervals_cover_as_often_as_they_say(n):
    """Of 500 samples 95 % (1 % around) should; beyond 91.5 and 99.5 % they are by chance once in 1000 lists of seeds.

    The median's resamples are few values, so that its interval covers more rather than less.
    """
    rng = np.random.default_rng(n)
    mean = median = 0
    for _ in range(500):
        result = summary(numbers(rng.normal(3.0, 2.0, n)))
        mean += result.mean_interval.low <= 3.0 <= result.mean_interval.high
        median += result.q50_interval.low <= 3.0 <= result.q50_interval.high
    assert 0.915 <= mean / 500 <= 0.985
    assert 0.915 <= median / 500 <= 0.995


@pytest.mark.parametrize(
    ("value", "text"),
    [(math.nan, "–"), (0.0, "0"), (-0.00012345, "-0.000123"), (999.4, "999"), (-123456.0, "-123456"), (2e9, "2e+09")],
)
def test_numbers_have_three_digits_or_all_before_the_point(value, text):
    assert number_text(value) == text


def test_texts_of_quartiles_of_times_beyond_the_limit_say_so():
    assert quartiles_text(summary(treated())) == "23 (13 to > 35)"
    assert quartiles_text(summary(times([50.0, 50.0], [False, False]))) == "> 50 (> 50 to > 50)"
    assert quartiles_text(summary(numbers([]))) == "–"


@pytest.mark.parametrize("interval", [UNKNOWN, Interval(-math.inf, math.inf), Interval(math.nan, math.inf)])
def test_interval_that_is_unbounded_or_unknown_is_written_as_a_dash(interval):
    assert interval_text(interval) == "–"


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


def test_difference_of_means_is_found_with_its_sign():
    low, high = mean_difference_interval(sluggish(1), sluggish(2) + 5.0)
    assert 2.0 < low < 5.0 < high < 8.0


def test_series_too_short_for_blocks_have_no_interval():
    assert np.isnan(mean_difference_interval(np.ones(9), np.ones(100))).all()


@given(st.lists(st.tuples(st.integers(-5, 5), st.integers(0, 3)), min_size=2, max_size=12))
def test_errors_of_resampled_means_are_those_of_the_seeds_drawn(rows):
    value, seed = np.array([row[0] for row in rows], float), np.array([row[1] for row in rows])
    counts, means = draw_counts_by_seed(seed)[0], bootstrapped_mean(value, seed)
    for resample in range(5):
        often, mean = counts[resample].astype(float), means.resampled[resample]
        times_drawn = [often[seed == one][0] for one in np.unique(seed)]
        sums = [np.sum(value[seed == one] - mean) for one in np.unique(seed)]
        expected = float(np.dot(times_drawn, np.square(sums))) / often.sum() ** 2
        assert means.squared_errors[resample] == pytest.approx(expected, rel=1e-3, abs=1e-5)


def test_interval_of_the_mean_of_a_skewed_sample_reaches_farther_on_the_long_side():
    result = summary(numbers(np.exp(np.linspace(-2.0, 2.0, 20))))
    assert result.mean_interval.high - result.mean > 1.3 * (result.mean - result.mean_interval.low)


@pytest.mark.parametrize("value", [[0.0] * 7 + [1.0], [1.0, 2.0], [0.0] * 30 + [1e9]])
def test_interval_of_the_mean_of_few_distinct_values_is_finite(value):
    result = summary(numbers(value))
    assert -math.inf < result.mean_interval.low < result.mean < result.mean_interval.high < math.inf


@pytest.mark.parametrize("value", [0.1, 0.9809, 1e-200, 1e12 / 3])
def test_interval_of_a_mean_whose_rounding_is_all_variance_is_that_value(value):
    values = np.full(100, value)
    values[::3] = np.nextafter(value, 2 * value)  # as numbers that were computed in different orders
    low, high = bootstrapped_mean(values).interval()
    assert low == pytest.approx(value, rel=1e-12)
    assert high == pytest.approx(value, rel=1e-12)
    assert low <= high


def test_interval_of_the_mean_of_equal_values_is_that_value():
    assert summary(numbers([3.0] * 5)).mean_interval == (3.0, 3.0)


def test_skewness_beyond_one_and_a_half_is_reported():
    """Of 1, 1, 1, 1, 6 it is sqrt(20) / 3 * 12 / 4^1.5 = 2.24; of 1, 2, 3, 4, 8 it is 1.18."""
    assert summary(numbers([1.0, 1.0, 1.0, 1.0, 6.0])).is_skewed
    assert not summary(numbers([1.0, 2.0, 3.0, 4.0, 8.0])).is_skewed
