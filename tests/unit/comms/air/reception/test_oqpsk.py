"""IEEE 802.15.4: the formula, evaluated apart with 40 digits, and the numbers that ns-3's tests and our table state."""

import math
from decimal import Decimal, getcontext

import pytest

from swarmwire.comms.air.decibels import from_db
from swarmwire.comms.air.reception.oqpsk import oqpsk_bit_errors, oqpsk_success

getcontext().prec = 40


@pytest.mark.parametrize("sinr_db", [-12.0, -7.0, -3.0, 0.0, 0.407, 2.0, 5.0, 9.0, 13.0])
def test_the_errors_of_802_15_4_are_exact(sinr_db: float):
    sinr = from_db(sinr_db)
    terms = ((-1) ** k * math.comb(16, k) * (20 * Decimal(sinr) * (Decimal(1) / k - 1)).exp() for k in range(2, 17))
    expected = float(sum(terms) * 8 / (15 * 16))
    # Below 0 dB the terms cancel each other down to a thousandth.
    assert oqpsk_bit_errors(sinr) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("sinr_db", "stated", "tolerance"),
    [
        (5, 7.386009e-14, 5e-20),
        (2, 5.131392e-07, 5e-13),
        (-1, 1.148944e-03, 5e-10),
        (-4, 3.916346e-02, 5e-9),
        (-7, 1.752462e-01, 5e-8),
    ],
)
def test_the_errors_of_802_15_4_are_those_of_ns3(sinr_db: float, stated: float, tolerance: float):
    assert oqpsk_bit_errors(from_db(sinr_db)) == pytest.approx(stated, abs=tolerance)


@pytest.mark.parametrize(
    ("sinr_db", "bit_errors", "lost_20", "lost_40", "lost_127"),
    [
        (-5, 7.517e-2, 1, 1, 1),
        (-4, 3.916e-2, 0.99833, 1, 1),
        (-3, 1.642e-2, 0.92926, 0.99500, 1),
        (-2, 5.197e-3, 0.56556, 0.81126, 0.99498),
        (-1, 1.149e-3, 0.16801, 0.30780, 0.68901),
        (0, 1.615e-4, 0.02552, 0.05038, 0.15136),
        (0.407, 6.227e-5, 0.00991, 0.01973, 0.06131),
        (1, 1.291e-5, 0.00206, 0.00412, 0.01303),
        (2, 5.131e-7, 0.00008, 0.00016, 0.00052),
        (3, 8.597e-9, 0, 0, 0.00001),
    ],
)
def test_frames_of_802_15_4_are_lost_by_the_table(sinr_db, bit_errors, lost_20, lost_40, lost_127):
    sinr = from_db(sinr_db)
    assert oqpsk_bit_errors(sinr) == pytest.approx(bit_errors, rel=2e-4)
    for octets, lost in ((20, lost_20), (40, lost_40), (127, lost_127)):
        # The table has five digits, and no row for frames that are lost surely but for 1e-5.
        assert 1.0 - oqpsk_success(sinr, octets * 8) == pytest.approx(lost, abs=1.2e-5)
