"""Where a response changes along a parameter, and seeds side by side."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.metrics.statistics.sample import by_seed
from swarmwire.metrics.statistics.trends import change_point, point_sums, resampled_sums
from tests.support.metrics.statistics.samples import numbers, times

LOSS = np.array([0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7])


def noise(seed, points=8, seeds=20):
    return np.random.default_rng(seed).normal(0.0, 0.1, (points, seeds))


def brute_force(table):
    """Place of the split with the least squares, by numpy's variances."""
    squares = [sum(part.var() * part.size for part in (table[:split], table[split:])) for split in range(1, len(table))]
    return int(np.argmin(squares))


def test_a_step_is_found_with_its_size():
    found = change_point(LOSS, noise(1) + np.where(LOSS >= 0.4, 0.3, 0.9)[:, None])
    assert found is not None
    assert (found.after, found.before, found.place) == (0.3, 0.4, pytest.approx(0.35))
    assert found.place_interval.low == found.place_interval.high == found.place
    assert found.below == pytest.approx(0.9, abs=0.03)
    assert found.effect == pytest.approx(-0.6, abs=0.04)
    assert found.effect_interval.low < -0.6 < found.effect_interval.high
    assert found.standardised == pytest.approx(-6.0, rel=0.2)
    assert found.gain > 0.0


def test_where_nothing_changes_a_step_is_found_in_one_case_of_a_hundred_at_most():
    """0.4 % expected; more than 5 of 200 would be found by chance once in a million lists of seeds."""
    assert sum(change_point(LOSS, noise(seed)) is not None for seed in range(200)) <= 5


def test_a_small_step_among_much_noise_has_a_wide_interval_that_holds_it():
    found = change_point(LOSS, noise(3) + np.where(LOSS >= 0.4, 0.08, 0.0)[:, None])
    assert found is not None
    assert found.place_interval.low < found.place_interval.high
    assert found.place_interval.low <= 0.35 <= found.place_interval.high


@given(st.integers(0, 10_000), st.integers(1, 7))
def test_the_step_is_where_brute_force_finds_it(seed, split):
    table = noise(seed) + np.where(np.arange(8) >= split, 1.0, 0.0)[:, None]
    found = change_point(LOSS, table)
    assert found is not None
    assert found.after == LOSS[brute_force(table)]


@given(st.integers(0, 10_000), st.floats(0.1, 10.0), st.sampled_from((0.0, -3.0, 1e7)))
def test_other_units_move_no_step(seed, unit, origin):
    table = noise(seed) + np.where(LOSS >= 0.3, 1.0, 0.0)[:, None]
    one, other = change_point(LOSS, table), change_point(LOSS, table * unit + origin)
    assert one is not None
    assert other is not None
    assert (one.place, one.place_interval) == (other.place, other.place_interval)
    assert other.effect == pytest.approx(one.effect * unit, rel=1e-4)


def test_points_and_runs_without_values_are_left_out():
    table = noise(1) + np.where(LOSS >= 0.4, 1.0, 0.0)[:, None]
    table[2] = np.nan
    table[5, :7] = np.nan
    found = change_point(LOSS, table)
    assert found is not None
    assert (found.after, found.before) == (0.3, 0.4)


@pytest.mark.parametrize(
    "table", [np.full((8, 5), 0.7), np.zeros((8, 5)), np.full((8, 5), np.nan), np.eye(8, 5) * np.nan]
)
def test_a_constant_has_no_step(table):
    assert change_point(LOSS, table) is None


def test_a_step_without_noise_is_found():
    found = change_point(LOSS, np.where(LOSS >= 0.4, 1.0, 0.0)[:, None] * np.ones(5))
    assert found is not None
    assert (found.place, found.effect, found.standardised) == (pytest.approx(0.35), 1.0, math.inf)


def test_sums_of_resamples_are_those_of_the_seeds_drawn():
    table = noise(2, 3, 4)
    table[1, 2] = np.nan
    once, often = point_sums(table), resampled_sums(table)
    mean = np.nanmean(table, axis=1)
    np.testing.assert_allclose(once.total / once.count, mean)
    assert once.count.tolist() == [4.0, 3.0, 4.0]
    assert (often.count[:, 0] == 4.0).all()
    np.testing.assert_allclose(often.total.sum(axis=0) / often.count.sum(axis=0), mean, atol=0.01)


def test_values_stand_side_by_side_seed_by_seed():
    table = by_seed([numbers([1.0, 2.0], [5, 3]), times([9.0], [False]), numbers([])])
    np.testing.assert_array_equal(table, [[np.nan, 2.0, 1.0], [9.0, np.nan, np.nan], [np.nan] * 3])
