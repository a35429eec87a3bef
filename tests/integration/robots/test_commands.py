"""What an agent decides reaches the robot in the units and with the signs of the contract, within its limits."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.agent.drivers.driver import Command
from tests.support.robots.properties import ON_ONE_RIG
from tests.support.robots.rig import Rig


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
