"""Receivers: what holds for every model of success, tables, thermal noise, sensitivity, and the scenario's choice."""

import math
from decimal import Decimal, getcontext

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.errors import BadInput
from swarmwire.comms.radio.config.phy import (
    Noise,
    Reception,
    SuccessTable,
    noise_dbm,
    refuse_unfit,
    refuse_unless_rising,
)
from swarmwire.comms.radio.propagation.decibels import from_db, to_db
from swarmwire.comms.radio.reception import error_rates
from swarmwire.comms.radio.reception.error_rates import all_right
from swarmwire.comms.radio.reception.receiver import (
    MAX_DB,
    MIN_DB,
    by_table,
    by_threshold,
    chunk_success,
    ieee80211ag,
    ieee80211b,
    ieee802154,
    receiver_of,
    sensitivity_dbm,
    sinr_for_db,
)
from swarmwire.comms.radio.timing import DSSS_RATES_BPS

getcontext().prec = 40
THRESHOLD = by_threshold(4.0)
BY_BITS = (
    by_table(SuccessTable((-1.0, 0.0, 3.0), (0.0, 0.2, 1.0), 1000)),
    ieee802154(),
    *(ieee80211b(rate_bps) for rate_bps in DSSS_RATES_BPS),
    *(ieee80211ag(rate_bps) for rate_bps in error_rates.OFDM_RATES_BPS),
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


MEASURED = SuccessTable((-94.0, -93.0, -90.0), (0.4, 0.6, 0.86), 800)


def test_a_table_gives_its_rows_a_straight_line_between_and_the_ends_beyond():
    receiver = by_table(MEASURED)
    for sinr_db, success in ((-94, 0.4), (-93.5, 0.5), (-93, 0.6), (-91.5, 0.73), (-90, 0.86), (-200, 0.4), (50, 0.86)):
        assert chunk_success(receiver, from_db(sinr_db), 800) == pytest.approx(success, rel=1e-12)
    assert chunk_success(receiver, 0.0, 800) == 0.4
    assert chunk_success(receiver, from_db(-93.5), 1600) == pytest.approx(0.25, rel=1e-12)


@pytest.mark.parametrize(
    ("sinr_db", "success", "key"),
    [
        ((0.0, 1.0, 1.0), (0.1, 0.2, 0.3), "sinr_db"),
        ((0.0, 2.0, 1.0), (0.1, 0.2, 0.3), "sinr_db"),
        ((0.0, 1.0, 2.0), (0.1, 0.3, 0.2), "success"),
        ((0.0, 1.0), (0.1, 1.1), "success"),
        ((0.0, 1.0), (-0.1, 1.0), "success"),
        ((0.0, 1.0), (0.1,), "success"),
        ((0.0,), (0.1,), "success"),
        ((0.0, math.nan), (0.1, 0.2), "sinr_db"),
    ],
)
def test_a_table_that_does_not_rise_is_refused(sinr_db, success, key: str):
    with pytest.raises(BadInput) as refused:
        refuse_unless_rising(SuccessTable(sinr_db, success, 100), "a.toml", "radio.reception")
    assert refused.value.key == f"radio.reception.{key}"


def test_a_table_that_rises_is_taken():
    refuse_unless_rising(MEASURED, "a.toml", "radio.reception")


getcontext().prec = 40
NS3_BOLTZMANN_DB = 10.0 * math.log10(1.3803e-23 / 1.380649e-23)


@pytest.mark.parametrize(
    ("bandwidth_hz", "stated_dbm"),
    [(1.0, -173.975), (1e6, -113.975), (2e6, -110.965)],
)
def test_thermal_noise_is_k_t_b(bandwidth_hz: float, stated_dbm: float):
    assert noise_dbm(bandwidth_hz) == pytest.approx(stated_dbm, abs=5e-4)
    assert noise_dbm(bandwidth_hz, 7.0) == pytest.approx(noise_dbm(bandwidth_hz) + 7.0, rel=1e-15)


@pytest.mark.parametrize(("bandwidth_hz", "stated_dbm"), [(5e6, -106.987), (20e6, -100.966), (22e6, -100.552)])
def test_thermal_noise_is_that_of_ns3_but_for_its_boltzmann_constant(bandwidth_hz: float, stated_dbm: float):
    """It has 1.3803e-23 J/K, which is 0.0011 dB less."""
    assert noise_dbm(bandwidth_hz) + NS3_BOLTZMANN_DB == pytest.approx(stated_dbm, abs=6e-4)


@given(st.floats(1e3, 1e9), st.floats(0.0, 40.0), st.floats(50.0, 500.0))
def test_thermal_noise_is_exact(bandwidth_hz: float, figure_db: float, temperature_k: float):
    milliwatts = 1000 * Decimal("1.380649e-23") * Decimal(temperature_k) * Decimal(bandwidth_hz)
    expected = float(10 * milliwatts.log10() + Decimal(figure_db))
    assert noise_dbm(bandwidth_hz, figure_db, temperature_k) == pytest.approx(expected, rel=1e-12, abs=1e-12)


def test_a_receivers_noise_is_thermal_noise_in_its_bandwidth_and_its_figure():
    assert Noise(bandwidth_hz=20e6, figure_db=7.0).power_dbm == noise_dbm(20e6, 7.0)


def test_sensitivity_of_802_15_4_is_that_of_ns3():
    assert sinr_for_db(ieee802154(), 0.99, 20 * 8) == pytest.approx(0.4035, abs=5e-4)
    assert sensitivity_dbm(ieee802154(), -106.987, 0.99, 20 * 8) == pytest.approx(-106.583, abs=1e-3)


def test_sensitivity_is_where_frames_begin_to_get_through():
    receiver = ieee80211ag(24_000_000)
    sinr_db = sinr_for_db(receiver, 0.9, 8000)
    assert chunk_success(receiver, from_db(sinr_db), 8000) == pytest.approx(0.9, rel=1e-9)


def test_what_always_or_never_succeeds_has_its_sensitivity_at_the_ends():
    flat = by_table(SuccessTable((0.0, 1.0), (0.5, 0.5), 8))
    assert sinr_for_db(flat, 0.4, 8) == pytest.approx(MIN_DB)
    assert sinr_for_db(flat, 0.6, 8) == MAX_DB


TABLE = SuccessTable((0.0, 6.0), (0.0, 1.0), 800)


@pytest.mark.parametrize(
    ("reception", "bit_rate_bps", "expected"),
    [
        (Reception(), 250_000, ieee802154()),
        (Reception("threshold", min_sinr_db=3.0), 1, by_threshold(3.0)),
        (Reception("table", table=TABLE), 1, by_table(TABLE)),
        *((Reception("802.11b"), rate_bps, ieee80211b(rate_bps)) for rate_bps in DSSS_RATES_BPS),
        *((Reception("802.11ag"), rate_bps, ieee80211ag(rate_bps)) for rate_bps in error_rates.OFDM_RATES_BPS),
    ],
)
def test_the_receiver_is_the_one_that_is_named(reception: Reception, bit_rate_bps: int, expected):
    refuse_unfit(reception, bit_rate_bps, "a.toml", "radio.reception")
    receiver = receiver_of(reception, bit_rate_bps)
    assert receiver[:4] == expected[:4]
    for sinr in (0.1, 1.0, 1.99, 2.0, 3.0, 10.0, 100.0):
        assert chunk_success(receiver, sinr, 400) == chunk_success(expected, sinr, 400)


@pytest.mark.parametrize(
    ("reception", "key"),
    [
        (Reception("table"), "radio.reception.table"),
        (Reception("table", table=SuccessTable((1.0, 0.0), (0.0, 1.0), 8)), "radio.reception.table.sinr_db"),
        (Reception("802.11b"), "radio.reception.model"),
        (Reception("802.11ag"), "radio.reception.model"),
    ],
)
def test_what_does_not_go_together_is_refused(reception: Reception, key: str):
    with pytest.raises(BadInput) as refused:
        refuse_unfit(reception, 250_000, "a.toml", "radio.reception")
    assert refused.value.key == key
