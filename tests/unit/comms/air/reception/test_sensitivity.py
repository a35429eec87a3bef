"""Noise and sensitivity: k T B F, and the power at which frames begin to get through."""

import math
from decimal import Decimal, getcontext

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.air.decibels import from_db
from swarmwire.comms.air.parameters.reception import SuccessTable
from swarmwire.comms.air.reception.noise import Noise, noise_dbm
from swarmwire.comms.air.reception.receiver import by_table, chunk_success, ieee80211ag, ieee802154
from swarmwire.comms.air.reception.sensitivity import LEAST_DB, MOST_DB, sensitivity_dbm, sinr_for_db

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
    assert sinr_for_db(flat, 0.4, 8) == pytest.approx(LEAST_DB)
    assert sinr_for_db(flat, 0.6, 8) == MOST_DB
