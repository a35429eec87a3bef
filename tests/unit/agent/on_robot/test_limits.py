import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.agent.drivers.driver import Command
from swarmwire.agent.on_robot.limits import SpeedLimits, limits_for
from swarmwire.comms.bodies.body import load_body
from swarmwire.comms.errors import BadInput

EPUCK2 = load_body("epuck2")
SPEEDS = st.floats(-1e3, 1e3)
LIMITS = SpeedLimits(0.1, 2.0, wheel_mps=0.12, wheel_base_m=0.053)


def test_limits_are_half_the_bodys_unless_the_settings_say_otherwise():
    limits = limits_for(EPUCK2, None, None, "robot.toml")
    assert limits.linear_mps == pytest.approx(0.0691)
    assert limits.angular_radps == pytest.approx(0.1382 / 0.053)
    raised = limits_for(EPUCK2, 0.1382, 5.0, "robot.toml")
    assert (raised.linear_mps, raised.angular_radps) == (0.1382, 5.0)


@pytest.mark.parametrize(("given", "key"), [((0.14, None), "max_linear_mps"), ((None, 5.3), "max_angular_radps")])
def test_limits_above_the_bodys_are_refused(given, key):
    with pytest.raises(BadInput, match=f"robot.toml: {key}: expected at most .* which the epuck2 can do"):
        limits_for(EPUCK2, *given, "robot.toml")


@given(SPEEDS, SPEEDS, SPEEDS)
def test_no_command_is_faster_than_the_limits_and_each_keeps_its_curve(linear, angular, lateral):
    asked = Command(linear, angular, lateral, {0: 3})
    got = LIMITS.clipped(asked)
    slack = 1.0 + 1e-9
    assert math.hypot(got.linear_mps, got.lateral_mps) <= 0.1 * slack
    assert abs(got.angular_radps) <= 2.0 * slack
    assert abs(got.linear_mps) + 0.5 * 0.053 * abs(got.angular_radps) <= 0.12 * slack
    assert got.linear_mps * angular == pytest.approx(got.angular_radps * linear)
    assert got.leds == {0: 3}
    assert got is asked or got != asked


def test_a_command_within_the_limits_is_left_alone():
    asked = Command(0.05, -1.0)
    assert LIMITS.clipped(asked) is asked


def test_infinite_speeds_keep_their_direction():
    got = LIMITS.clipped(Command(math.inf, 1.0))
    assert got.linear_mps == pytest.approx(0.1)
    assert abs(got.angular_radps) < 1e-3
