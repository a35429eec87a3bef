"""Effect sizes against brute force and known values; the log-rank test against a textbook's."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.metrics.statistics.effect_size import cliffs_delta, hedges_g
from swarmwire.metrics.statistics.log_rank import log_rank
from tests.support.metrics.statistics.samples import number_samples, numbers, placebo, time_samples, times, treated


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


def test_the_log_rank_test_of_the_leukaemia_trial_is_that_of_the_textbooks():
    found = log_rank(treated(), placebo())
    assert found.z**2 == pytest.approx(16.79, abs=0.005)
    assert found.z < 0.0
    assert found.p == pytest.approx(4.17e-5, rel=0.01)


@pytest.mark.parametrize(
    "pair",
    [
        (times([]), times([1.0])),
        (times([3.0], [False]), times([3.0], [False])),
        (times([1.0]), times([1.0])),
        (times([1.0, 2.0], [False, False]), times([3.0, 4.0])),
    ],
)
def test_the_log_rank_test_is_none_where_nothing_tells_samples_apart(pair):
    assert math.isnan(log_rank(*pair).p)
