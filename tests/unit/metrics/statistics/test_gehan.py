"""The order of censored times, and the test of pairs that stands on it."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given

from swarmwire.metrics.statistics.gehan import paired_p, surely_greater, surely_less
from tests.support.metrics.statistics.samples import time_samples, times


@given(time_samples, time_samples)
def test_who_is_surely_less_has_the_other_surely_greater(one, other):
    assert surely_less(one, other).sum() == surely_greater(other, one).sum()
    assert surely_greater(one, other).sum() == surely_less(other, one).sum()


def test_a_censored_time_is_after_all_observed_up_to_then_and_before_none():
    waited, seen = times([5.0], [False]), times([4.0, 5.0, 6.0])
    assert surely_less(waited, seen).tolist() == [2]
    assert surely_greater(waited, seen).tolist() == [0]
    assert surely_greater(seen, waited).tolist() == [1, 1, 0]
    assert surely_less(waited, waited).tolist() == [0]


def exact_p(one, other):
    """Of all ways to swap the two of each pair, the share in which their scores differ at least as much."""
    both = times(np.concatenate([one.value, other.value]), np.concatenate([one.observed, other.observed]))
    score = surely_less(both, both) - surely_greater(both, both)
    change = score[len(one) :] - score[: len(one)]
    sums = [abs(np.dot(signs, change)) for signs in itertools.product((-1, 1), repeat=len(change))]
    return np.mean(np.array(sums) >= abs(change.sum()))


@pytest.mark.parametrize("seed", range(10))
def test_the_p_value_of_pairs_is_near_that_of_swapping_the_two_of_each(seed):
    rng = np.random.default_rng(seed)
    first, second = rng.exponential(10.0, 12), rng.exponential(20.0, 12)
    one, other = (times(np.minimum(value, 15.0), value <= 15.0) for value in (first, second))
    assert paired_p(one, other) == pytest.approx(exact_p(one, other), abs=0.06)
    assert paired_p(one, other) == paired_p(other, one)


def test_pairs_that_are_alike_are_found_different_as_seldom_as_they_should():
    """5 % of 1000 are 50, 7 around; beyond 30 and 72 by chance once in 1000 lists of seeds."""
    rng = np.random.default_rng(8)
    found = 0
    for _ in range(1000):
        share = rng.exponential(10.0, 25)
        values = (share + rng.exponential(5.0, 25) for _ in range(2))
        one, other = (times(np.minimum(value, 20.0), value <= 20.0) for value in values)
        found += paired_p(one, other) < 0.05
    assert 30 <= found <= 72


def test_where_no_order_is_known_nothing_is_told():
    assert math.isnan(paired_p(times([3.0, 3.0], [False, False]), times([3.0, 3.0], [False, False])))
