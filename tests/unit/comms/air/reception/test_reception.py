"""Reception: what holds for every model that turns SINR into success."""

import math
from decimal import Decimal, getcontext

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.air.decibels import from_db, to_db
from swarmwire.comms.air.parameters.reception import SuccessTable
from swarmwire.comms.air.reception import dsss, ofdm
from swarmwire.comms.air.reception.bits import all_right
from swarmwire.comms.air.reception.receiver import (
    by_table,
    by_threshold,
    chunk_success,
    ieee80211ag,
    ieee80211b,
    ieee802154,
)

getcontext().prec = 40
THRESHOLD = by_threshold(4.0)
BY_BITS = (
    by_table(SuccessTable((-1.0, 0.0, 3.0), (0.0, 0.2, 1.0), 1000)),
    ieee802154(),
    *(ieee80211b(rate_bps) for rate_bps in dsss.RATES_BPS),
    *(ieee80211ag(rate_bps) for rate_bps in ofdm.RATES_BPS),
)


def test_a_threshold_passes_from_its_ratio_on():
    assert [chunk_success(THRESHOLD, from_db(db), 10_000) for db in (3.9, 4.0, 4.1)] == [0.0, 1.0, 1.0]


@pytest.mark.parametrize("receiver", [THRESHOLD, *BY_BITS])
@given(st.floats(-40.0, 50.0), st.floats(-40.0, 50.0), st.integers(0, 20_000))
def test_more_signal_never_has_less_success(receiver, one_db: float, other_db: float, bits: int):
    weak, strong = (chunk_success(receiver, from_db(db), bits) for db in sorted((one_db, other_db)))
    assert weak <= strong + 1e-12
    assert weak >= 0.0
    assert strong <= 1.0


@pytest.mark.parametrize("receiver", BY_BITS)
@given(st.floats(-10.0, 30.0), st.floats(0.0, 20_000.0), st.floats(0.0, 20_000.0))
def test_chunks_of_a_frame_multiply(receiver, sinr_db: float, one_bits: float, other_bits: float):
    sinr = from_db(sinr_db)
    product = chunk_success(receiver, sinr, one_bits) * chunk_success(receiver, sinr, other_bits)
    assert product == pytest.approx(chunk_success(receiver, sinr, one_bits + other_bits), rel=1e-9, abs=1e-300)


@pytest.mark.parametrize("receiver", BY_BITS)
def test_no_bits_are_always_right_and_no_signal_is_no_frame(receiver):
    assert chunk_success(receiver, 0.0, 0) == 1.0
    assert chunk_success(receiver, 0.0, 1000) < 1e-6
    assert chunk_success(receiver, 1e6, 10_000) == 1.0


@given(st.floats(1e-18, 0.4), st.integers(1, 20_000))
def test_frames_keep_the_digits_of_rare_errors(error_rate: float, bits: int):
    assert all_right(error_rate, bits) == pytest.approx(float((1 - Decimal(error_rate)) ** bits), rel=1e-11, abs=1e-300)


@given(st.floats(-200.0, 200.0))
def test_decibels_and_ratios_are_inverse(db: float):
    assert to_db(from_db(db)) == pytest.approx(db, rel=1e-13, abs=1e-13)


def test_no_power_is_minus_infinity_decibels():
    assert to_db(0.0) == -math.inf
    assert from_db(-math.inf) == 0.0
