"""Differences of samples, their distances and effect sizes: known values, brute force and scipy."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from swarmwire.metrics.statistics.difference import (
    cliffs_delta,
    difference,
    hedges_g,
    kolmogorov_smirnov,
    wasserstein_1,
)
from swarmwire.metrics.statistics.sample import time_sample
from swarmwire.metrics.statistics.survival import log_rank
from tests.support.metrics.samples import number_samples, numbers, placebo, time_samples, times, treated


def censored(value, limit):
    return times(np.minimum(value, limit), value <= limit)


def test_seeds_that_both_have_are_compared_one_by_one():
    first = numbers([1.0, 20.0, 3.0, 99.0], seed=[1, 2, 3, 8])
    second = numbers([3.5, 2.5, 20.5, -7.0], seed=[3, 1, 2, 9])
    result = difference(first, second)
    assert (result.pairs, result.test) == (3, "Wilcoxon signed-rank")
    assert (result.median, result.mean) == (0.5, pytest.approx(2.5 / 3.0))
    assert result.p == 0.25


def test_paired_difference_cancels_what_seeds_share():
    rng = np.random.default_rng(5)
    shared = rng.normal(0.0, 5.0, 40)
    first, second = shared + rng.normal(0.0, 0.1, 40), shared + 0.3 + rng.normal(0.0, 0.1, 40)
    paired = difference(numbers(first), numbers(second))
    apart = difference(numbers(first), numbers(second, np.arange(100, 140)))
    assert paired.median_interval.low > 0.1
    assert paired.p < 1e-6
    assert apart.median_interval.low < 0.0 < apart.median_interval.high
    assert (apart.pairs, apart.test) == (0, "Mann-Whitney")


@pytest.mark.parametrize(
    ("one", "other", "discrete"),
    [
        ([1.0, 1.0, 2.0, 1.0], [1.0, 2.0, 2.0, 1.0], True),
        ([0.1, 0.2, 0.3, 0.4], [0.5, 0.6, 0.7, 0.8], False),
        (np.repeat(np.arange(11.0), 4), np.repeat(np.arange(11.0), 4), False),
    ],
)
def test_numbers_of_few_values_are_discrete(one, other, discrete):
    assert difference(numbers(one), numbers(other)).is_discrete == discrete


@settings(max_examples=4)  # each resamples two samples, twice
@given(number_samples, number_samples)
def test_turning_the_two_turns_the_sign(one, other):
    forth, back = difference(one, other), difference(other, one)
    assert forth.median == -back.median
    assert forth.mean == pytest.approx(-back.mean, abs=1e-12)
    assert forth.delta == -back.delta
    assert forth.p == pytest.approx(back.p, nan_ok=True)


@given(st.one_of(number_samples, time_samples))
def test_sample_does_not_differ_from_itself(sample):
    result = difference(sample, sample)
    assert result.median == 0.0 or math.isnan(result.median)
    assert (result.mean, result.delta) == (0.0, 0.0)
    assert result.p == 1.0 or math.isnan(result.p)


@pytest.mark.parametrize("pair", [(numbers([]), numbers([1.0])), (times([]), times([])), (times([2.0]), times([]))])
def test_difference_with_an_empty_sample_is_nan(pair):
    result = difference(*pair)
    assert result.pairs == 0
    assert all(
        math.isnan(value) for value in (result.median, result.mean, result.delta, result.p, *result.mean_interval)
    )


def test_times_without_pairs_have_the_difference_of_survivals_medians():
    first = time_sample(treated().value, treated().observed, np.arange(100, 121))
    result = difference(first, placebo())
    assert (result.pairs, result.test, result.median) == (0, "log-rank", 8.0 - 23.0)
    assert result.p == pytest.approx(4.17e-5, rel=0.01)
    assert result.median_interval.high < 0.0
    assert result.horizon == 6.0  # when the first was no longer watched
    assert result.mean == pytest.approx(np.minimum(placebo().value, 6.0).mean() - 6.0)


def test_median_beyond_the_limit_leaves_its_difference_unknown():
    rng = np.random.default_rng(2)
    result = difference(censored(rng.exponential(5.0, 40), 50.0), censored(rng.exponential(500.0, 40), 50.0))
    assert math.isnan(result.median)
    assert result.median_interval.low > 30.0
    assert result.median_interval.high == math.inf
    assert result.delta > 0.9
    assert (result.test, result.horizon) == ("paired Gehan", 50.0)
    assert result.p < 1e-6
    assert 30.0 < result.mean_interval.low < result.mean < result.mean_interval.high < 50.0


def test_medians_both_beyond_the_limit_leave_the_difference_unbounded():
    rng = np.random.default_rng(2)
    result = difference(censored(rng.exponential(500.0, 40), 50.0), censored(rng.exponential(500.0, 40), 50.0))
    assert result.median_interval == (-math.inf, math.inf)


@pytest.mark.parametrize("shared", [True, False])
def test_intervals_of_differences_cover_as_often_as_they_say(shared):
    """Of 100 pairs of samples 95 % (2.2 % around) should; fewer than 88 % do by chance once in 1000 lists of seeds.

    Those of medians are wider, as resampled medians are few values.
    """
    rng = np.random.default_rng(17)
    covered = {"numbers": 0, "means": 0, "times": 0}
    seeds = np.arange(25) if shared else np.arange(100, 125)
    for _ in range(100):
        one, other = rng.normal(0.0, 1.0, 25), rng.normal(0.5, 1.0, 25)
        result = difference(numbers(one), numbers(other, seeds))
        covered["numbers"] += result.median_interval.low <= 0.5 <= result.median_interval.high
        covered["means"] += result.mean_interval.low <= 0.5 <= result.mean_interval.high
        one, other = rng.exponential(10.0, 25), rng.exponential(20.0, 25)
        later = time_sample(np.minimum(other, 40.0), other <= 40.0, seeds)
        result = difference(censored(one, 40.0), later)
        truth = 10.0 * math.log(2.0)
        covered["times"] += result.median_interval.low <= truth <= result.median_interval.high
    assert 88 <= covered["means"] <= 99
    assert covered["numbers"] >= 88
    assert covered["times"] >= 88


DRAWS = np.random.default_rng(1)
PAIRS = {
    "apart": (DRAWS.normal(0.0, 1.0, 300), DRAWS.normal(0.5, 2.0, 170)),
    "with ties": (DRAWS.integers(0, 5, 200) * 1.0, DRAWS.integers(1, 7, 90) * 1.0),
    "one value": (np.array([2.0]), np.array([2.0, 3.0, 7.0])),
    "constants": (np.full(10, 4.0), np.full(3, 4.0)),
}


@pytest.mark.parametrize("name", PAIRS)
def test_distances_are_those_of_scipy(name):
    a, b = PAIRS[name]
    assert kolmogorov_smirnov(a, b) == pytest.approx(stats.ks_2samp(a, b, method="asymp").statistic, abs=1e-12)
    assert wasserstein_1(a, b) == pytest.approx(stats.wasserstein_distance(a, b), rel=1e-9, abs=1e-12)


def test_distance_to_an_empty_sample_is_nan():
    assert np.isnan(kolmogorov_smirnov(np.zeros(0), np.ones(3)))
    assert np.isnan(wasserstein_1(np.ones(3), np.zeros(0)))


def surely_greater(one, other, i, j):
    if one.observed[i]:
        return bool(other.observed[j] and one.value[i] > other.value[j])
    return bool(other.observed[j] and one.value[i] >= other.value[j])


def brute_force(one, other):
    pairs = [(i, j) for i in range(len(one)) for j in range(len(other))]
    return sum(surely_greater(one, other, i, j) - surely_greater(other, one, j, i) for i, j in pairs) / len(pairs)


@given(st.one_of(st.tuples(number_samples, number_samples), st.tuples(time_samples, time_samples)))
def test_cliffs_delta_is_what_counting_all_pairs_gives(pair):
    assert cliffs_delta(*pair) == pytest.approx(brute_force(*pair), abs=1e-12)


@given(number_samples, number_samples)
def test_cliffs_delta_turns_with_its_samples_and_stays_under_what_keeps_the_order(one, other):
    delta = cliffs_delta(one, other)
    assert cliffs_delta(other, one) == -delta
    assert cliffs_delta(numbers(one.value**3), numbers(other.value**3)) == delta
    assert cliffs_delta(one, one) == 0.0


def test_samples_that_do_not_overlap_are_at_the_end_of_the_scale():
    assert cliffs_delta(numbers([5.0, 6.0]), numbers([1.0, 2.0, 3.0])) == 1.0
    assert cliffs_delta(times([9.0, 9.0], [False, False]), times([9.0, 1.0])) == 1.0
    assert cliffs_delta(times([9.0], [False]), times([9.0], [False])) == 0.0
    assert math.isnan(cliffs_delta(numbers([]), numbers([1.0])))


def test_hedges_g_is_the_difference_in_standard_deviations_less_what_small_samples_add():
    first, second = np.array([3.0, 5.0, 7.0]), np.array([2.0, 4.0, 6.0])  # both have a standard deviation of 2
    assert hedges_g(first, second) == pytest.approx(0.5 * (1.0 - 3.0 / 15.0))
    assert hedges_g(second, first) == -hedges_g(first, second)


@pytest.mark.parametrize("pair", [([], [1.0]), ([1.0], [2.0]), ([1.0, 1.0], [1.0, 1.0])])
def test_hedges_g_is_none_where_nothing_varies(pair):
    assert math.isnan(hedges_g(np.array(pair[0]), np.array(pair[1])))


def test_log_rank_test_of_the_leukaemia_trial_is_that_of_textbooks():
    test = log_rank(treated(), placebo())
    assert test.z**2 == pytest.approx(16.79, abs=0.005)
    assert test.z < 0.0
    assert test.p == pytest.approx(4.17e-5, rel=0.01)


@pytest.mark.parametrize(
    "pair",
    [
        (times([]), times([1.0])),
        (times([3.0], [False]), times([3.0], [False])),
        (times([1.0]), times([1.0])),
        (times([1.0, 2.0], [False, False]), times([3.0, 4.0])),
    ],
)
def test_log_rank_p_is_nan_where_samples_cannot_be_told_apart(pair):
    assert math.isnan(log_rank(*pair).p)
