"""The form of a degradation, and scaling with the number of robots."""

import math

import numpy as np
import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.metrics.statistics.sample import UNKNOWN
from swarmwire.metrics.statistics.trends import Fit, degradation, relative_to_unharmed, scaling

SHARE = np.linspace(0.0, 0.9, 10)


def noisy(curve, seed):
    return curve[:, None] + np.random.default_rng(seed).normal(0.0, 0.05, (10, 20))


@pytest.mark.parametrize("seed", range(20))
def test_the_lower_aic_is_that_of_the_true_form(seed):
    """The two curves are 4 standard errors apart at their farthest, so AIC errs less than once in 1e4."""
    line = degradation(SHARE, noisy(1.0 - SHARE, seed))
    exponential = degradation(SHARE, noisy(np.exp(-2.0 * SHARE), seed))
    assert line is not None
    assert exponential is not None
    assert (line.better.form, exponential.better.form) == ("linear", "exponential")
    assert line.is_clear
    assert exponential.is_clear
    assert line.better.r_squared > 0.9


def test_a_fit_says_what_is_left_at_a_stress():
    of = {"a_interval": UNKNOWN, "b_interval": UNKNOWN, "r_squared": 1.0, "aic": 0.0}
    assert Fit("linear", 1.0, -0.5, **of).at(np.array([0.0, 0.4])).tolist() == pytest.approx([1.0, 0.8])
    assert Fit("exponential", 2.0, -1.0, **of).at(np.array([0.5])).tolist() == pytest.approx([2 * math.exp(-0.5)])


def test_the_line_is_that_of_least_squares():
    table = noisy(1.0 - 0.5 * SHARE, 1)
    fitted = degradation(SHARE, table)
    assert fitted is not None
    slope, start = np.polyfit(np.repeat(SHARE, 20), table.ravel(), 1)
    assert (fitted.linear.a, fitted.linear.b) == (pytest.approx(start), pytest.approx(slope))


def test_slopes_lie_in_their_intervals_as_often_as_they_say():
    """Of 300 samples 95 % (1.3 % around) should, for either form; this fails by chance once in 1000 lists of seeds."""
    covered = {"linear": 0, "exponential": 0}
    for seed in range(300):
        for form, curve, slope in (("linear", 1.0 - SHARE, -1.0), ("exponential", np.exp(-SHARE), -1.0)):
            fitted = degradation(SHARE, noisy(curve, seed))
            assert fitted is not None
            low, high = getattr(fitted, form).b_interval
            covered[form] += low <= slope <= high
    assert all(0.91 <= count / 300 <= 0.99 for count in covered.values())


def test_runs_on_a_curve_are_fitted_exactly():
    fitted = degradation(SHARE, np.exp(-1.5 * SHARE)[:, None])
    assert fitted is not None
    assert (fitted.better.form, fitted.better.b) == ("exponential", pytest.approx(-1.5))
    assert fitted.better.at(np.array([0.2])) == pytest.approx(np.exp(-0.3))
    assert fitted.better.r_squared == pytest.approx(1.0)


def test_what_does_not_fall_has_no_slope_and_the_forms_are_not_told_apart():
    flat = degradation(SHARE, np.full((10, 3), 0.8))
    assert flat is not None
    assert flat.linear.b == pytest.approx(0.0, abs=1e-12)
    assert not flat.is_clear
    assert flat.better.form == "linear"


@pytest.mark.parametrize("value", [0.0, -1.0])
def test_performance_that_is_none_ends_no_fit(value):
    fitted = degradation(SHARE, np.full((10, 3), value))
    assert fitted is not None
    assert fitted.linear.a == pytest.approx(value)
    assert math.isnan(fitted.linear.r_squared)


def test_two_stresses_are_too_few():
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
    for found in (work, times):
        np.testing.assert_allclose(found.speed_up, ROBOTS)
        np.testing.assert_allclose(found.efficiency, 1.0)
        np.testing.assert_allclose(found.serial_fraction, [np.nan, 0.0, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize("serial", [0.05, 0.3, 1.0])
def test_amdahls_law_has_its_serial_fraction(serial):
    found = scaling(ROBOTS, serial + (1.0 - serial) / ROBOTS, is_time=True)
    np.testing.assert_allclose(found.serial_fraction[1:], serial)


def test_without_a_single_robot_the_smallest_swarm_is_the_reference():
    found = scaling(np.array([20.0, 5.0, 10.0]), np.array([40.0, 20.0, 30.0]), is_time=False)
    assert found.reference == 5.0
    np.testing.assert_allclose(found.speed_up, [2.0, 1.0, 1.5])
    np.testing.assert_allclose(found.efficiency, [0.5, 1.0, 0.75])
    np.testing.assert_allclose(found.serial_fraction, [1.0 / 3.0, np.nan, 1.0 / 3.0])


def test_times_that_are_not_known_have_no_efficiency_and_resamples_go_row_by_row():
    response = np.array([[60.0, 30.0, np.nan, 0.0], [60.0, 60.0, 60.0, 60.0]])
    found = scaling(ROBOTS, response, is_time=True)
    np.testing.assert_allclose(found.efficiency, [[1.0, 1.0, np.nan, np.nan], 1.0 / ROBOTS])


@pytest.mark.parametrize("robots", [[1.0], [1.0, 1.0], [0.0, 1.0], []])
def test_sizes_that_do_not_tell_are_refused(robots):
    with pytest.raises(BadInput):
        scaling(np.array(robots), np.ones(len(robots)), is_time=False)
