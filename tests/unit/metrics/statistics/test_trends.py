"""How a response changes along a parameter or with the number of robots: change points, degradation and scaling."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.base.errors import BadInput
from swarmwire.metrics.statistics.bootstrap import draw_counts
from swarmwire.metrics.statistics.sample import UNKNOWN, SeedTable, by_seed
from swarmwire.metrics.statistics.scaling import scaling
from swarmwire.metrics.statistics.trends import (
    Fit,
    change_point,
    degradation,
    point_sums,
    relative_means,
    relative_to_unharmed,
    resampled_sums,
)
from tests.support.metrics.samples import numbers, times

SHARE = np.linspace(0.0, 0.9, 10)


def noisy(curve, seed):
    return curve[:, None] + np.random.default_rng(seed).normal(0.0, 0.05, (10, 20))


@pytest.mark.parametrize("seed", range(20))
def test_lower_aic_is_that_of_the_true_form(seed):
    """The two curves are 4 standard errors apart at their farthest, so AIC errs less than once in 1e4."""
    line = degradation(SHARE, noisy(1.0 - SHARE, seed))
    exponential = degradation(SHARE, noisy(np.exp(-2.0 * SHARE), seed))
    assert line is not None
    assert exponential is not None
    assert (line.better.form, exponential.better.form) == ("linear", "exponential")
    assert line.is_clear
    assert exponential.is_clear
    assert line.better.r_squared > 0.9


def test_fit_evaluates_performance_at_a_stress():
    fields = {"a_interval": UNKNOWN, "b_interval": UNKNOWN, "r_squared": 1.0, "aic": 0.0}
    assert Fit("linear", 1.0, -0.5, **fields).evaluate(np.array([0.0, 0.4])).tolist() == pytest.approx([1.0, 0.8])
    assert Fit("exponential", 2.0, -1.0, **fields).evaluate(np.array([0.5])).tolist() == pytest.approx(
        [2 * math.exp(-0.5)]
    )


def test_linear_degradation_is_the_fit_of_least_squares():
    table = noisy(1.0 - 0.5 * SHARE, 1)
    fitted = degradation(SHARE, table)
    assert fitted is not None
    slope, start = np.polyfit(np.repeat(SHARE, 20), relative_to_unharmed(SHARE, table).ravel(), 1)
    assert (fitted.linear.a, fitted.linear.b) == (pytest.approx(start), pytest.approx(slope))


def test_duplicated_seed_narrows_no_interval():
    table = noisy(np.exp(-SHARE), 5)
    once, twice = (
        degradation(SHARE, SeedTable(np.tile(table, copies), np.tile(np.arange(20), copies))) for copies in (1, 2)
    )
    assert once is not None
    assert twice is not None
    for form in ("linear", "exponential"):
        assert getattr(twice, form).b_interval == pytest.approx(getattr(once, form).b_interval, rel=1e-6)
    np.testing.assert_allclose(
        *(relative_means(SHARE, SeedTable(np.tile(table, k), np.tile(np.arange(20), k)))[1] for k in (1, 2)), rtol=1e-6
    )
    table = noisy(np.where(SHARE >= 0.5, 0.4, 0.9), 5)
    steps = [change_point(SHARE, SeedTable(np.tile(table, k), np.tile(np.arange(20), k))) for k in (1, 2)]
    assert all(step is not None for step in steps)
    np.testing.assert_allclose(*(step.effect_interval for step in steps if step is not None), rtol=1e-6)


def test_refitted_slopes_are_those_of_the_runs_drawn():
    """The interval's ends lie among slopes that scipy fits to resamples of whole seeds."""
    table = noisy(np.exp(-2.0 * SHARE), 7)
    fitted = degradation(SHARE, table)
    assert fitted is not None
    slopes = []
    for row in draw_counts(20)[:60].astype(int):
        value = np.repeat(table, row, axis=1)
        again = degradation(SHARE, value)
        assert again is not None
        slopes.append(again.exponential.b)
    low, high = fitted.exponential.b_interval
    assert np.mean((low <= np.array(slopes)) & (np.array(slopes) <= high)) == pytest.approx(0.95, abs=0.06)


def test_runs_on_a_curve_are_fitted_exactly():
    fitted = degradation(SHARE, np.exp(-1.5 * SHARE)[:, None])
    assert fitted is not None
    assert (fitted.better.form, fitted.better.b) == ("exponential", pytest.approx(-1.5))
    assert fitted.better.evaluate(np.array([0.2])) == pytest.approx(np.exp(-0.3))
    assert fitted.better.r_squared == pytest.approx(1.0)


def test_flat_performance_has_no_slope_and_no_clear_form():
    flat = degradation(SHARE, np.full((10, 3), 0.8))
    assert flat is not None
    assert flat.linear.b == pytest.approx(0.0, abs=1e-12)
    assert not flat.is_clear
    assert flat.better.form == "linear"


def test_degradation_of_zero_performance_is_none():
    assert degradation(SHARE, np.zeros((10, 3))) is None


def test_performance_that_does_not_vary_has_no_share_of_variance():
    fitted = degradation(SHARE, np.full((10, 3), 4.0))
    assert fitted is not None
    assert fitted.linear.a == pytest.approx(1.0)
    assert math.isnan(fitted.linear.r_squared)


def test_degradation_of_two_stresses_is_none():
    table = noisy(1.0 - SHARE, 1)
    table[2:] = np.nan
    assert degradation(SHARE, table) is None


def test_performance_is_relative_to_the_mean_of_the_unharmed():
    table = np.array([[1.0, 3.0], [4.0, np.nan]])
    np.testing.assert_array_equal(relative_to_unharmed(np.array([0.5, 0.0]), table), table / 4.0)
    assert np.isnan(relative_to_unharmed(np.array([0.0, 0.5]), np.zeros((2, 2)))).all()


ROBOTS = np.array([1.0, 2.0, 5.0, 10.0])


def test_robots_that_do_not_hinder_one_another_are_wholly_efficient():
    work, times = scaling(ROBOTS, 3.0 * ROBOTS, is_time=False), scaling(ROBOTS, 60.0 / ROBOTS, is_time=True)
    for result in (work, times):
        np.testing.assert_allclose(result.speed_up, ROBOTS)
        np.testing.assert_allclose(result.efficiency, 1.0)
        np.testing.assert_allclose(result.serial_fraction, [np.nan, 0.0, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize("serial", [0.05, 0.3, 1.0])
def test_amdahls_law_has_its_serial_fraction(serial):
    result = scaling(ROBOTS, serial + (1.0 - serial) / ROBOTS, is_time=True)
    np.testing.assert_allclose(result.serial_fraction[1:], serial)


def test_without_a_single_robot_the_smallest_swarm_is_the_reference():
    result = scaling(np.array([20.0, 5.0, 10.0]), np.array([40.0, 20.0, 30.0]), is_time=False)
    assert result.reference == 5.0
    np.testing.assert_allclose(result.speed_up, [2.0, 1.0, 1.5])
    np.testing.assert_allclose(result.efficiency, [0.5, 1.0, 0.75])
    np.testing.assert_allclose(result.serial_fraction, [1.0 / 3.0, np.nan, 1.0 / 3.0])


def test_times_that_are_not_known_have_no_efficiency_and_resamples_go_row_by_row():
    response = np.array([[60.0, 30.0, np.nan, 0.0], [60.0, 60.0, 60.0, 60.0]])
    result = scaling(ROBOTS, response, is_time=True)
    np.testing.assert_allclose(result.efficiency, [[1.0, 1.0, np.nan, np.nan], 1.0 / ROBOTS])


@pytest.mark.parametrize("robots", [[1.0], [1.0, 1.0], [0.0, 1.0], []])
def test_sizes_that_do_not_tell_are_refused(robots):
    with pytest.raises(BadInput):
        scaling(np.array(robots), np.ones(len(robots)), is_time=False)


LOSS = np.array([0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7])


def noise(seed, points=8, seeds=20):
    return np.random.default_rng(seed).normal(0.0, 0.1, (points, seeds))


def brute_force(table):
    """Place of the split with the least squares, by numpy's variances."""
    squares = [sum(part.var() * part.size for part in (table[:split], table[split:])) for split in range(1, len(table))]
    return int(np.argmin(squares))


def test_step_is_found_with_its_size():
    step = change_point(LOSS, noise(1) + np.where(LOSS >= 0.4, 0.3, 0.9)[:, None])
    assert step is not None
    assert (step.after, step.before, step.position) == (0.3, 0.4, pytest.approx(0.35))
    assert step.position_interval.low == step.position_interval.high == step.position
    assert step.below == pytest.approx(0.9, abs=0.03)
    assert step.effect == pytest.approx(-0.6, abs=0.04)
    assert step.effect_interval.low < -0.6 < step.effect_interval.high
    assert step.standardised == pytest.approx(-6.0, rel=0.2)
    assert step.gain > 0.0


def test_step_is_found_in_noise_once_in_a_hundred_at_most():
    """Of 200, more than 5 would be found by chance once in a thousand lists of seeds; these are fixed."""
    assert sum(change_point(LOSS, noise(seed)) is not None for seed in range(200)) <= 5


@pytest.mark.parametrize("points", [3, 8, 20])
def test_straight_line_has_no_step(points):
    """A link PDR of 1 - loss, with noise of 0.02 and without."""
    loss = np.linspace(0.0, 0.9, points)
    exact = np.broadcast_to((1.0 - loss)[:, None], (points, 10))
    assert change_point(loss, exact) is None
    tables = [exact + np.random.default_rng(seed).normal(0.0, 0.02, exact.shape) for seed in range(20)]
    assert not any(change_point(loss, table) for table in tables)


def test_cliff_is_a_step_and_neither_line_nor_exponential():
    cliff = np.where(SHARE >= 0.85, 0.07, 1.0)
    fitted = degradation(SHARE, noisy(cliff, 1))
    assert fitted is not None
    assert fitted.is_step
    assert fitted.step is not None
    assert fitted.step.position == pytest.approx(0.85)
    assert fitted.step.r_squared > 0.9
    assert fitted.better.r_squared < 0.5
    line = degradation(SHARE, noisy(1.0 - SHARE, 1))
    assert line is not None
    assert not line.is_step


def test_small_step_in_much_noise_has_a_wide_interval_that_holds_it():
    step = change_point(LOSS, noise(3) + np.where(LOSS >= 0.4, 0.08, 0.0)[:, None])
    assert step is not None
    assert step.position_interval.low < step.position_interval.high
    assert step.position_interval.low <= 0.35 <= step.position_interval.high


@given(st.integers(0, 10_000), st.integers(1, 7))
def test_step_is_where_brute_force_finds_it(seed, split):
    table = noise(seed) + np.where(np.arange(8) >= split, 1.0, 0.0)[:, None]
    step = change_point(LOSS, table)
    assert step is not None
    assert step.after == LOSS[brute_force(table)]


@given(st.integers(0, 10_000), st.floats(0.1, 10.0), st.sampled_from((0.0, -3.0, 1e7)))
def test_other_units_move_no_step(seed, unit, origin):
    table = noise(seed) + np.where(LOSS >= 0.3, 1.0, 0.0)[:, None]
    one, other = change_point(LOSS, table), change_point(LOSS, table * unit + origin)
    assert one is not None
    assert other is not None
    assert (one.position, one.position_interval) == (other.position, other.position_interval)
    assert other.effect == pytest.approx(one.effect * unit, rel=1e-4)


def test_points_and_runs_without_values_are_left_out():
    table = noise(1) + np.where(LOSS >= 0.4, 1.0, 0.0)[:, None]
    table[2] = np.nan
    table[5, :7] = np.nan
    step = change_point(LOSS, table)
    assert step is not None
    assert (step.after, step.before) == (0.3, 0.4)


@pytest.mark.parametrize(
    "table", [np.full((8, 5), 0.7), np.zeros((8, 5)), np.full((8, 5), np.nan), np.eye(8, 5) * np.nan]
)
def test_constant_response_has_no_step(table):
    assert change_point(LOSS, table) is None


def test_step_without_noise_is_found():
    step = change_point(LOSS, np.where(LOSS >= 0.4, 1.0, 0.0)[:, None] * np.ones(5))
    assert step is not None
    assert (step.position, step.effect, step.standardised) == (pytest.approx(0.35), 1.0, math.inf)


def test_sums_of_resamples_are_those_of_the_seeds_drawn():
    table = noise(2, 3, 4)
    table[1, 2] = np.nan
    once, often = point_sums(SeedTable.from_table(table)), resampled_sums(SeedTable.from_table(table))
    mean = np.nanmean(table, axis=1)
    np.testing.assert_allclose(once.total / once.count, mean)
    assert once.count.tolist() == [4.0, 3.0, 4.0]
    assert (often.count[:, 0] == 4.0).all()
    np.testing.assert_allclose(often.total.sum(axis=0) / often.count.sum(axis=0), mean, atol=0.01)


def test_values_stand_side_by_side_seed_by_seed():
    table = by_seed([numbers([1.0, 2.0], [5, 3]), times([9.0], [False]), numbers([])])
    np.testing.assert_array_equal(table.value, [[np.nan, 2.0, 1.0], [9.0, np.nan, np.nan], [np.nan] * 3])
    assert table.seed.tolist() == [0, 3, 5]
