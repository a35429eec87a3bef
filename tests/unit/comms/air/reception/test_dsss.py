"""IEEE 802.11b: the formulas, evaluated apart with 40 digits or by quadrature, and what ns-3's tests state."""

from decimal import Decimal, getcontext

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import integrate, special

from swarmwire.comms.air.decibels import from_db
from swarmwire.comms.air.reception.dsss import (
    RATES_BPS,
    biorthogonal_errors,
    dbpsk_bit_errors,
    dqpsk_bit_errors,
    dsss_success,
)

getcontext().prec = 40
PI = Decimal("3.1415926535897932384626433832795028841972")
EXACT = 1e-12
FRAME_BITS, NOISE_DBM = (1024 + 40 + 14) * 8, -93.5522786  # of ns-3's test


@given(st.floats(-20.0, 15.0))
def test_the_errors_of_802_11b_at_1_and_2_mbps_are_exact(sinr_db: float):
    sinr = Decimal(from_db(sinr_db))
    assert dbpsk_bit_errors(float(sinr)) == pytest.approx(float((-22 * sinr).exp() / 2), rel=EXACT)
    x, root2 = 11 * sinr, Decimal(2).sqrt()
    bound = (root2 + 1) / (8 * PI * root2 * x).sqrt() * (-(2 - root2) * x).exp()
    assert dqpsk_bit_errors(float(sinr)) == pytest.approx(min(float(bound), 0.5), rel=EXACT)


@pytest.mark.parametrize("signal", [0.0, 0.3, 1.0, 3.0, 6.0, 10.0, 15.0])
def test_the_errors_of_biorthogonal_codes_agree_with_quadrature(signal: float):
    def not_all_lower(y: float) -> float:
        wrong = -np.expm1(7.0 * np.log1p(-special.erfc(y / np.sqrt(2.0))))
        return wrong * np.exp(-0.5 * (y - signal) ** 2) / np.sqrt(2.0 * np.pi)

    up_to, _ = integrate.quad(not_all_lower, 0.0, 0.5 * signal, epsabs=0.0, epsrel=1e-13)
    beyond, _ = integrate.quad(not_all_lower, 0.5 * signal, 0.5 * signal + 15.0, epsabs=0.0, epsrel=1e-13)
    expected = up_to + beyond + 0.5 * special.erfc(signal / np.sqrt(2.0))
    assert biorthogonal_errors(signal) == pytest.approx(expected, rel=EXACT)


def test_without_signal_one_of_sixteen_codes_is_guessed():
    assert biorthogonal_errors(0.0) == pytest.approx(15 / 16, rel=1e-14)


@pytest.mark.parametrize(
    ("rate_bps", "rss_dbm", "stated", "tolerance"),
    [
        (1_000_000, -105, 0, 1e-13),
        (1_000_000, -100, 1.5e-13, 1e-13),
        (1_000_000, -99, 0.0003, 1e-4),
        (1_000_000, -98, 0.202, 5e-3),
        (1_000_000, -97, 0.813, 5e-3),
        (1_000_000, -96, 0.984, 5e-3),
        (1_000_000, -95, 0.999, 1e-3),
        (2_000_000, -96, 0, 1e-13),
        (2_000_000, -95, 4.5e-6, 1e-6),
        (2_000_000, -94, 0.036, 5e-3),
        (2_000_000, -93, 0.519, 5e-3),
        (2_000_000, -92, 0.915, 5e-3),
        (2_000_000, -91, 0.993, 5e-3),
        (2_000_000, -90, 0.999, 1e-3),
        (5_500_000, -94, 0, 1e-13),
        (5_500_000, -93, 6.6e-14, 1e-14),
        (5_500_000, -92, 1e-4, 5e-5),
        (5_500_000, -91, 0.132, 5e-3),
        (5_500_000, -90, 0.744, 5e-3),
        (5_500_000, -89, 0.974, 5e-3),
        (5_500_000, -88, 0.999, 1e-3),
        (11_000_000, -91, 0, 1e-14),
        (11_000_000, -90, 4.7e-14, 1e-14),
        (11_000_000, -89, 8.85e-5, 1e-5),
        (11_000_000, -88, 0.128, 5e-3),
        (11_000_000, -87, 0.739, 5e-3),
        (11_000_000, -86, 0.973, 5e-3),
        (11_000_000, -85, 0.999, 1e-3),
    ],
)
def test_frames_of_802_11b_survive_as_in_ns3(rate_bps: int, rss_dbm: float, stated: float, tolerance: float):
    sinr = from_db(rss_dbm - NOISE_DBM)
    assert dsss_success(RATES_BPS.index(rate_bps), sinr, FRAME_BITS) == pytest.approx(stated, abs=tolerance)
