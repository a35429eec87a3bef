"""Times that may be censored: their survival, their order, and the test of pairs that stands on it."""

import itertools
import math
import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from swarmwire.metrics.statistics.bootstrap import draw_counts
from swarmwire.metrics.statistics.survival import (
    kaplan_meier,
    paired_p,
    resampled_quantiles,
    surely_greater,
    surely_less,
)
from tests.support.metrics.samples import placebo, time_samples, times, treated

shares = st.floats(0.01, 0.99)


def at(curve, column, time):
    return getattr(curve, column)[np.searchsorted(curve.time, time)]


def test_survival_of_the_leukaemia_trial_is_that_of_textbooks():
    curve = kaplan_meier(treated())
    published = {6: 0.8571, 7: 0.8067, 10: 0.7529, 13: 0.6902, 16: 0.6275, 22: 0.5378, 23: 0.4482}
    for time, survival in published.items():
        assert at(curve, "survival", time) == pytest.approx(survival, abs=5e-5)
    error = {6: 0.0764, 7: 0.0869, 10: 0.0963, 13: 0.1068, 16: 0.1141, 22: 0.1282, 23: 0.1346}
    for time, standard_error in error.items():
        deviation = at(curve, "survival", time) * math.sqrt(at(curve, "variance", time))
        assert deviation == pytest.approx(standard_error, abs=5e-5)
    assert (curve.quantile(0.25), curve.quantile(0.5)) == (13.0, 23.0)
    assert math.isnan(curve.quantile(0.75))
    assert kaplan_meier(placebo()).quantile(0.5) == 8.0


def test_intervals_of_the_medians_of_the_leukaemia_trial_are_those_of_the_log_log_band():
    low, high = kaplan_meier(treated()).quantile_interval(0.5)
    assert (low, high) == (13.0, math.inf)
    assert kaplan_meier(placebo()).quantile_interval(0.5) == (4.0, 11.0)


@given(time_samples, st.sampled_from((0.8, 0.95)))
def test_survival_and_band_are_those_of_scipy(sample, level):
    ours = kaplan_meier(sample, level)
    theirs = stats.ecdf(stats.CensoredData.right_censored(sample.value, ~sample.observed)).sf
    assert theirs.quantiles.tolist() == ours.time.tolist()
    np.testing.assert_allclose(ours.survival, theirs.probabilities, atol=1e-12)
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        band = theirs.confidence_interval(level, method="log-log")
    inner = (ours.survival > 1e-9) & (ours.survival < 1.0 - 1e-9)
    np.testing.assert_allclose(ours.low[inner], band.low.probabilities[inner], atol=1e-9)
    np.testing.assert_allclose(ours.high[inner], band.high.probabilities[inner], atol=1e-9)


@given(time_samples, shares, shares)
def test_quantiles_never_fall_with_the_share(sample, one, other):
    first, second = (kaplan_meier(sample).quantile(share) for share in sorted((one, other)))
    assert first <= second or math.isnan(second)


@given(time_samples, shares)
def test_quantile_lies_within_its_interval(sample, share):
    curve = kaplan_meier(sample)
    (low, high), quantile = curve.quantile_interval(share), curve.quantile(share)
    assert not low > quantile
    assert not high < quantile


@given(time_samples, shares, st.floats(0.1, 10.0))
def test_other_units_of_time_give_the_same_quantile_in_that_unit(sample, share, unit):
    scaled = times(sample.value * unit, sample.observed)
    np.testing.assert_allclose(kaplan_meier(scaled).quantile(share), kaplan_meier(sample).quantile(share) * unit)


@given(time_samples, shares)
def test_resample_of_each_value_once_has_the_quantile_of_the_sample(sample, share):
    quantile = kaplan_meier(sample).quantile(share)
    resampled = resampled_quantiles(sample, np.ones((1, len(sample))), share)[0]
    assert resampled == (math.inf if math.isnan(quantile) else quantile)


@given(time_samples, shares)
def test_quantiles_of_resamples_are_those_of_the_values_drawn(sample, share):
    counts = draw_counts(len(sample))[:5]
    for count, resampled in zip(counts, resampled_quantiles(sample, counts, share), strict=True):
        picked = np.repeat(np.arange(len(sample)), count.astype(np.int64))
        quantile = kaplan_meier(times(sample.value[picked], sample.observed[picked])).quantile(share)
        assert resampled == (math.inf if math.isnan(quantile) else quantile)


def test_restricted_mean_of_uncensored_times_is_their_mean_up_to_horizon():
    value = np.array([1.0, 4.0, 4.0, 9.0, 20.0])
    for horizon in (0.5, 4.0, 10.0, 20.0, 30.0):
        assert kaplan_meier(times(value)).restricted_mean(horizon) == pytest.approx(np.minimum(value, horizon).mean())


def test_mean_terms_of_uncensored_times_are_the_times_up_to_the_horizon():
    value = np.random.default_rng(4).exponential(10.0, 200)
    for horizon in (5.0, float(value.max())):
        terms = kaplan_meier(times(value)).mean_terms(times(value), horizon)
        np.testing.assert_allclose(terms, np.minimum(value, horizon))


def test_restricted_mean_of_the_leukaemia_trial_is_that_of_textbooks():
    curve = kaplan_meier(treated())
    assert curve.restricted_mean(35.0) == pytest.approx(23.287, abs=1e-3)
    terms = curve.mean_terms(treated(), 35.0)
    assert terms.mean() == pytest.approx(23.287, abs=1e-3)
    assert terms.std() / math.sqrt(len(terms)) == pytest.approx(2.827, abs=1e-3)


def test_survival_of_no_times_is_nan():
    curve = kaplan_meier(times([]))
    assert math.isnan(curve.quantile(0.5))
    assert math.isnan(curve.restricted_mean(3.0))
    assert all(math.isnan(end) for end in curve.quantile_interval(0.5))


def test_quantiles_lie_beyond_where_nothing_happened():
    curve = kaplan_meier(times([5.0, 5.0], [False, False]))
    assert math.isnan(curve.quantile(0.01))
    assert curve.restricted_mean(5.0) == 5.0
    assert curve.mean_terms(times([5.0, 5.0], [False, False]), 5.0).tolist() == [5.0, 5.0]


def test_intervals_of_a_censored_median_cover_it_as_often_as_they_say():
    """Of 400 samples 95 % (2.2 % around) should; this fails by chance in less than 1 of 1000 lists of seeds."""
    rng = np.random.default_rng(11)
    covered = 0
    for _ in range(400):
        value = rng.exponential(10.0, 40)
        low, high = kaplan_meier(times(np.minimum(value, 15.0), value <= 15.0)).quantile_interval(0.5)
        covered += bool(low <= 10.0 * math.log(2.0) <= high)
    assert 0.91 <= covered / 400 <= 0.99


@given(time_samples, time_samples)
def test_surely_less_and_surely_greater_are_inverse(one, other):
    assert surely_less(one, other).sum() == surely_greater(other, one).sum()
    assert surely_greater(one, other).sum() == surely_less(other, one).sum()


def test_censored_time_is_after_times_before_it_and_before_none():
    waited, observed = times([5.0], [False]), times([4.0, 5.0, 6.0])
    assert surely_less(waited, observed).tolist() == [2]
    assert surely_greater(waited, observed).tolist() == [0]
    assert surely_greater(observed, waited).tolist() == [1, 1, 0]
    assert surely_less(waited, waited).tolist() == [0]


def exact_p(one, other):
    """Of all ways to swap the two of each pair, the share in which their scores differ at least as much."""
    both = times(np.concatenate([one.value, other.value]), np.concatenate([one.observed, other.observed]))
    score = surely_less(both, both) - surely_greater(both, both)
    change = score[len(one) :] - score[: len(one)]
    sums = [abs(np.dot(signs, change)) for signs in itertools.product((-1, 1), repeat=len(change))]
    return np.mean(np.array(sums) >= abs(change.sum()))


@pytest.mark.parametrize("seed", range(10))
def test_p_of_pairs_is_near_that_of_all_swaps_within_pairs(seed):
    rng = np.random.default_rng(seed)
    first, second = rng.exponential(10.0, 12), rng.exponential(20.0, 12)
    one, other = (times(np.minimum(value, 15.0), value <= 15.0) for value in (first, second))
    assert paired_p(one, other) == pytest.approx(exact_p(one, other), abs=0.06)
    assert paired_p(one, other) == paired_p(other, one)


def test_pairs_that_are_alike_are_found_different_as_seldom_as_they_should():
    """5 % of 1000 are 50, 7 around; beyond 30 and 72 by chance once in 1000 lists of seeds."""
    rng = np.random.default_rng(8)
    rejections = 0
    for _ in range(1000):
        share = rng.exponential(10.0, 25)
        values = (share + rng.exponential(5.0, 25) for _ in range(2))
        one, other = (times(np.minimum(value, 20.0), value <= 20.0) for value in values)
        rejections += paired_p(one, other) < 0.05
    assert 30 <= rejections <= 72


@pytest.mark.parametrize("observed", [[True, True], [False, False]])
def test_paired_identical_times_have_p_of_one(observed):
    """Every exchange within pairs gives the same statistic, so all of them are as extreme."""
    sample = times([3.0, 3.0], observed)
    assert paired_p(sample, sample) == 1.0
