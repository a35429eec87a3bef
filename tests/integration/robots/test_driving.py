"""Readings come through and commands arrive, on every rig."""

from math import pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.agent.drivers.driver import Command
from tests.support.robots.rig import Rig, made_up_readings
from tests.support.robots.rigs import ON_ONE_RIG, RIGS


def with_sensor(name: str) -> pytest.MarkDecorator:
    """Only rigs that have it."""
    return pytest.mark.parametrize("rig", [rig for rig, kind in RIGS.items() if name in kind.measures()], indirect=True)


def test_a_driver_measures_what_its_robot_and_gateway_have(connected: Rig) -> None:
    assert connected.driver.measures == connected.measures()
    assert connected.driver.measures <= connected.body.sensors.keys()
    assert connected.driver.measures <= connected.gateway.sensors


@ON_ONE_RIG
@given(data=st.data())
def test_a_reading_comes_back_as_exactly_as_the_wire_can_tell_it(connected: Rig, data: st.DataObject) -> None:
    connected.come_back(data.draw(made_up_readings(connected.body, connected.driver.measures)))


def test_only_senses_that_were_asked_for_are_read(connected: Rig) -> None:
    for name in connected.driver.measures:
        assert {field.partition(".")[0] for field in connected.driver.sense(frozenset({name}))} == {name}
    assert connected.driver.sense(frozenset()) == {}


@with_sensor("proximity")
def test_a_wall_on_the_left_is_read_on_the_left(connected: Rig) -> None:
    proximity = connected.body.proximity
    assert proximity is not None
    on_the_left = proximity.angle_rad > 0.0
    sensed = connected.come_back({"proximity.value": 0.5 * on_the_left[None, :]})
    assert (sensed["proximity.value"][0, on_the_left] > 0.4).all()
    assert (sensed["proximity.value"][0, ~on_the_left] < 0.1).all()


@with_sensor("compass")
@pytest.mark.parametrize("heading_rad", [0.0, 0.5 * pi, -0.5 * pi, 3.0])
def test_a_heading_is_counted_counter_clockwise_from_the_arenas_x(connected: Rig, heading_rad: float) -> None:
    sensed = connected.come_back({"compass.heading_rad": np.array([heading_rad])})
    assert sensed["compass.heading_rad"][0] == pytest.approx(heading_rad, abs=1e-5)


@with_sensor("odometry")
@ON_ONE_RIG
@given(gone=st.lists(st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)), min_size=1, max_size=20))
def test_odometry_adds_up_however_far_the_wheels_roll(connected: Rig, gone: list[tuple[float, float]]) -> None:
    left_m, right_m = (
        float(connected.driver.sense(frozenset({"odometry"}))[f"odometry.{side}_m"][0]) for side in ("left", "right")
    )
    for left, right in gone:
        left_m, right_m = left_m + left * connected.farthest_m, right_m + right * connected.farthest_m
        connected.come_back({"odometry.left_m": np.array([left_m]), "odometry.right_m": np.array([right_m])})


@ON_ONE_RIG
@given(share=st.floats(-0.5, 0.5), turn=st.floats(-0.5, 0.5))
def test_speeds_within_the_limits_arrive_as_they_are(connected: Rig, share: float, turn: float) -> None:
    linear_mps, angular_radps = share * connected.body.max_linear_mps, turn * connected.body.max_angular_radps
    connected.driver.act(Command(linear_mps, angular_radps))
    connected.until_told(linear_mps, angular_radps)


@pytest.mark.parametrize("sign", [1, -1])
def test_speeds_beyond_the_limits_are_cut_to_them(connected: Rig, sign: int) -> None:
    body = connected.body
    connected.driver.act(Command(sign * 10.0 * body.max_linear_mps, 0.0))
    connected.until_told(sign * body.max_linear_mps, 0.0)
    connected.driver.act(Command(0.0, sign * 10.0 * body.max_angular_radps))
    connected.until_told(0.0, sign * body.max_angular_radps)


def test_each_led_shows_what_it_was_told_and_the_others_what_they_showed(connected: Rig) -> None:
    red, dark = 0xFF0000, 0
    shown = dict.fromkeys(range(connected.body.led_count), dark)
    for which in shown:
        for colour in (red, dark, red):
            connected.driver.act(Command(0.01 * (which + 1), leds={which: colour}))
            connected.driver.sense(frozenset())
            shown |= connected.told().leds
            assert shown[which] == colour
    assert set(shown.values()) <= {red}


def test_an_open_driver_has_told_its_robot_to_rest(rig: Rig) -> None:
    rig.connect()
    rig.until_told(0.0, 0.0)


def test_a_robot_is_told_to_rest_when_its_driver_is_closed(connected: Rig) -> None:
    connected.driver.act(Command(0.05, 0.0))
    connected.until_told(0.05, 0.0)
    connected.driver.close()
    connected.until_told(0.0, 0.0)
    connected.driver.close()
