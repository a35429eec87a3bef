"""IEEE 802.11a and g: the union bound, evaluated apart with fractions, and what ns-3's tests state."""

import math
from decimal import Decimal, getcontext
from fractions import Fraction

import numpy as np
import pytest
from scipy import special

from swarmwire.comms.air.decibels import from_db
from swarmwire.comms.air.reception.ofdm import RATES_BPS, SPECTRA, ofdm_bit_errors, ofdm_success, raw_bit_errors

getcontext().prec = 60
PI = Decimal("3.14159265358979323846264338327950288419716939937510582097494")
EXACT = 1e-12
FRAME_BITS = 2000 * 8  # of ns-3's test


def erfc(x: Decimal) -> Decimal:
    """1 - 2 / sqrt(pi) sum of (-1)^n x^(2n+1) / (n! (2n+1)); its terms reach 10^14 for x = 6, of 60 digits."""
    term, total, n = x, x, 0
    while abs(term) > Decimal("1e-55"):
        n += 1
        term *= -x * x / n
        total += term / (2 * n + 1)
    return 1 - 2 / PI.sqrt() * total


@pytest.mark.parametrize("points", [2, 4, 16, 64])
@pytest.mark.parametrize("sinr", [0.0, 0.01, 0.5, 2.0, 7.5, 20.0])
def test_raw_errors_by_modulation_are_exact(points: int, sinr: float):
    """Evaluated apart with 60 digits: erfc(sqrt(s)) of BPSK, and so on."""
    s = Decimal(sinr)
    if points <= 4:
        expected = erfc((s if points == 2 else s / 2).sqrt()) / 2
    else:
        side = math.isqrt(points)
        bits = side.bit_length() - 1  # log2 of the side
        expected = Decimal(side - 1) / (side * bits) * erfc((3 * s / (2 * (points - 1))).sqrt())
    assert raw_bit_errors(points, sinr) == pytest.approx(float(expected), rel=EXACT)


@pytest.mark.parametrize("rate", range(8))
@pytest.mark.parametrize("sinr_db", [3.0, 6.0, 10.0, 15.0, 20.0, 24.0])
def test_the_errors_of_802_11ag_are_the_union_bound(rate: int, sinr_db: float):
    sinr = from_db(sinr_db)
    points = (2, 2, 4, 4, 16, 16, 64, 64)[rate]
    raw = {
        2: 0.5 * special.erfc(np.sqrt(sinr)),
        4: 0.5 * special.erfc(np.sqrt(sinr / 2.0)),
        16: 3.0 / 8.0 * special.erfc(np.sqrt(sinr / 10.0)),
        64: 7.0 / 24.0 * special.erfc(np.sqrt(sinr / 42.0)),
    }[points]
    first, step, factor, weights = SPECTRA[(0, 2, 0, 2, 0, 2, 1, 2)[rate]]
    d = Fraction(float(np.sqrt(4.0 * raw * (1.0 - raw))))
    bound = Fraction(factor).limit_denominator(6) * sum(w * d ** (first + i * step) for i, w in enumerate(weights))
    # Errors of erfc count up to 26-fold.
    assert ofdm_bit_errors(rate, sinr) == pytest.approx(min(float(bound), 1.0), rel=EXACT, abs=1e-300)


@pytest.mark.parametrize(
    ("rate_mbps", "sinr_db", "stated", "tolerance"),
    [
        (6, 2.5, 2.04e-10, 1e-12),
        (6, 3.0, 0.020, 1e-3),
        (6, 4.0, 0.885, 1e-3),
        (6, 5.0, 0.997, 1e-3),
        (9, 6.0, 0.097, 1e-3),
        (9, 7.0, 0.918, 1e-3),
        (9, 8.0, 0.998, 1e-3),
        (12, 6.0, 0.0174, 1e-3),
        (12, 7.0, 0.881, 1e-3),
        (12, 8.0, 0.997, 1e-3),
        (18, 8.5, 2.85e-6, 1e-8),
        (18, 9.5, 0.623, 1e-3),
        (18, 10.5, 0.985, 1e-3),
        (24, 12.0, 2.22e-7, 1e-9),
        (24, 13.0, 0.495, 1e-3),
        (24, 14.0, 0.974, 1e-3),
        (36, 15.5, 0.012, 1e-3),
        (36, 16.5, 0.818, 1e-3),
        (36, 17.5, 0.993, 1e-3),
        (48, 20.0, 1.3e-4, 1e-6),
        (48, 21.0, 0.649, 1e-3),
        (48, 22.0, 0.983, 1e-3),
        (54, 21.0, 5.44e-8, 1e-10),
        (54, 22.0, 0.410, 1e-3),
        (54, 23.0, 0.958, 1e-3),
    ],
)
def test_frames_of_802_11ag_survive_as_in_ns3(rate_mbps: int, sinr_db: float, stated: float, tolerance: float):
    rate = RATES_BPS.index(rate_mbps * 1_000_000)
    assert ofdm_success(rate, from_db(sinr_db), FRAME_BITS) == pytest.approx(stated, abs=tolerance)


def test_two_milliseconds_of_the_lowest_ht_rate_survive_as_in_ns3():
    assert ofdm_success(0, from_db(4.0), 13_000) == pytest.approx(0.905685, abs=1e-6)
