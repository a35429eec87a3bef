"""The gamma distribution: tails and quantile as scipy has them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import special

from swarmwire.comms.air.propagation.gamma import gamma_quantile, gamma_tails
from swarmwire.comms.air.propagation.nakagami import nakagami_gain


@pytest.mark.parametrize("shape", [0.5, 0.6, 0.75, 1.0, 1.5, 3.0, 10.0, 200.0])
def test_the_gamma_quantile_agrees_with_scipy(shape: float):
    for small in (*np.geomspace(1e-15, 0.4999, 40), 0.5):
        low, high = gamma_quantile(shape, small, 1.0 - small), gamma_quantile(shape, 1.0 - small, small)
        assert low == pytest.approx(special.gammaincinv(shape, small), rel=1e-11)
        assert high == pytest.approx(special.gammainccinv(shape, small), rel=1e-11)


@given(st.floats(0.5, 200.0), st.floats(0.0, 600.0))
def test_the_tails_of_gamma_agree_with_scipy(shape: float, x: float):
    below, above = gamma_tails(shape, x)
    assert below + above == pytest.approx(1.0, rel=1e-15)
    smaller = (below, special.gammainc(shape, x)) if below < above else (above, special.gammaincc(shape, x))
    assert smaller[0] == pytest.approx(smaller[1], rel=2e-12, abs=1e-290)


def test_the_gamma_quantile_has_the_ends_of_its_range():
    assert gamma_quantile(1.5, 0.0, 1.0) == 0.0
    assert gamma_quantile(1.5, 1.0, 0.0) == np.inf
    assert nakagami_gain(0.0, 0.75) == 0.0
    assert np.isfinite(nakagami_gain(32.0, 0.5))


def test_the_gamma_quantile_is_infinite_where_nothing_is_above_and_0_where_nothing_is_below():
    assert gamma_quantile(0.75, 1.0, 0.0) == np.inf
    assert gamma_quantile(0.75, 0.0, 1.0) == 0.0
    assert gamma_tails(0.75, 0.0) == (0.0, 1.0)
