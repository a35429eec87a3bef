"""The e-puck2's numbers and what they mean, by the values that its maker and data sheets give."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.bodies.body import load_body
from swarmwire.comms.robots.epuck2 import packets, units
from swarmwire.comms.sheets import Scan

SHARES = st.floats(0.0, 1.0)
BODY = load_body("epuck2")


def tof() -> Scan:
    assert BODY.scan is not None
    return BODY.scan


@given(st.lists(SHARES, min_size=1, max_size=8).map(np.array))
def test_shares_come_back_within_half_a_step(value) -> None:
    assert np.abs(units.proximity(units.to_proximity(value)) - value).max() <= 0.5 / units.PROXIMITY_FULL + 1e-12
    assert np.abs(units.light(units.to_light(value)) - value).max() <= 0.5 / units.AMBIENT_DARK + 1e-12
    shade = units.shade(units.to_shade(value), units.GROUND_BLACK, units.GROUND_WHITE)
    assert np.abs(shade - value).max() <= 0.5 / (units.GROUND_WHITE - units.GROUND_BLACK) + 1e-12


@given(st.floats(0.05, 1.99))
def test_a_distance_comes_back_within_half_a_millimetre(range_m) -> None:
    told = units.distance_m(units.to_distance(np.array([range_m]), tof()), tof())
    assert abs(float(told[0]) - range_m) <= 0.0005 + 1e-12


def test_nothing_in_sight_is_beyond_the_range() -> None:
    told = units.to_distance(np.array([np.inf]), tof())
    assert told.tolist() == [units.SEES_NOTHING_MM]
    assert np.isinf(units.distance_m(told, tof())).all()


def test_dark_is_four_thousand_and_bright_less() -> None:
    assert units.to_light(np.array([0.0, 0.5, 1.0])).tolist() == [4000.0, 2000.0, 0.0]


def test_one_g_is_eight_hundred_and_two_g_are_the_most() -> None:
    assert units.to_acceleration(np.array([9.80665, -9.80665, 100.0])).tolist() == [800.0, -800.0, 1536.0]
    assert pytest.approx(800.0) == 9.80665 * units.PER_MPS2


def test_250_degrees_a_second_are_the_most_that_the_gyro_tells() -> None:
    quarter = np.deg2rad(62.5)
    assert units.to_turn(np.array([quarter, -quarter, 10.0])).tolist() == [8192.0, -8192.0, 32767.0]


def test_a_full_battery_and_an_empty_one() -> None:
    # GCtronic's driver: V = raw / (4096 x 0.6 / 3.0)
    assert units.to_voltage(np.array([4.2, 3.4])).tolist() == [round(4.2 * 819.2), round(3.4 * 819.2)]
    assert pytest.approx(819.2) == units.PER_V


def test_headers_say_how_much_follows() -> None:
    assert packets.PORT == 1000
    assert {int(header): packets.PAYLOAD_BYTES[header] for header in packets.Header} == {1: 38400, 2: 104, 3: 0}
