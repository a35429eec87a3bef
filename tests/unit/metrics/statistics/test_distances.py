"""Distances between samples are those of scipy, and what their names promise."""

import numpy as np
import pytest
from scipy import stats

from swarmwire.metrics.statistics.distances import kolmogorov_smirnov, wasserstein_1

DRAWS = np.random.default_rng(1)
PAIRS = {
    "apart": (DRAWS.normal(0.0, 1.0, 300), DRAWS.normal(0.5, 2.0, 170)),
    "with ties": (DRAWS.integers(0, 5, 200) * 1.0, DRAWS.integers(1, 7, 90) * 1.0),
    "one value": (np.array([2.0]), np.array([2.0, 3.0, 7.0])),
    "constants": (np.full(10, 4.0), np.full(3, 4.0)),
}


@pytest.mark.parametrize("name", PAIRS)
def test_they_are_those_of_scipy(name):
    a, b = PAIRS[name]
    assert kolmogorov_smirnov(a, b) == pytest.approx(stats.ks_2samp(a, b, method="asymp").statistic, abs=1e-12)
    assert wasserstein_1(a, b) == pytest.approx(stats.wasserstein_distance(a, b), rel=1e-9, abs=1e-12)


def test_a_shift_is_a_distance_in_the_values_unit():
    a = DRAWS.normal(size=500)
    assert wasserstein_1(a, a + 0.25) == pytest.approx(0.25)
    assert kolmogorov_smirnov(a, a + 100.0) == 1.0
    assert kolmogorov_smirnov(a, a[::-1]) == wasserstein_1(a, a[::-1]) == 0.0


def test_nothing_has_no_distance():
    assert np.isnan(kolmogorov_smirnov(np.zeros(0), np.ones(3)))
    assert np.isnan(wasserstein_1(np.ones(3), np.zeros(0)))
