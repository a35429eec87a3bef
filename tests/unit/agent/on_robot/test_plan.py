"""What an agent on a robot would run with: drivers, needs, limits, parameters and body."""

import hashlib
import math
import tomllib
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.agent.drivers.driver import GROUP, Command, Driver, driver_names, load_driver
from swarmwire.agent.on_robot.controller import Controller, group_of
from swarmwire.agent.on_robot.plan import (
    OF_POSES,
    Capabilities,
    RobotConfig,
    SpeedLimits,
    agent_sha256,
    check_needs,
    limits_for,
    robot_config,
    tracked,
)
from swarmwire.agent.on_robot.settings import read_settings
from swarmwire.comms.bodies.body import load_body
from swarmwire.comms.errors import BadInput
from swarmwire.comms.packets import NO_TX_STATUSES, ReceivedPackets
from tests.support.agent.on_robot.scripted import PLAYERS, DatedFakeClock


def _plan(agent: str = "Driving", beside: Path | None = None, **more: Any) -> RobotConfig:
    """The plan of an e-puck2; nothing is connected."""
    flags = {"agent": f"{PLAYERS}:{agent}", "driver.name": "epuck2", "driver.address": "10.0.0.1", **more}
    file = None
    if beside:
        file = beside / "robot.toml"
        file.write_text("format = 1\n")
    settings = read_settings(file, {key: (key, value) for key, value in flags.items()})
    return robot_config(settings, "robot.toml", DatedFakeClock())


SWARM = {"robots": ["flock-0", "flock-1", "flock-2"], "name": "flock-1"}


def test_of_a_list_with_a_value_for_each_robot_a_robot_has_its_own():
    plan = _plan("Laned", params={"lane": [3, 4, 5]}, **SWARM)
    assert plan.params == {"lane": 4}
    settings = plan.settings
    group = group_of(settings.name, settings.index, settings.agent, plan.params, plan.body, seed=1)
    mind = Controller(group, 10, None, plan.limits)
    assert mind.step(0, {}, ReceivedPackets.none(), NO_TX_STATUSES).command.linear_mps == pytest.approx(0.04)


@pytest.mark.parametrize(
    ("params", "told"),
    [
        ({"lane": [3, 4]}, "lane: expected a whole number, or a list with one for each of the 3 robots"),
        ({"lane": 0.5}, "lane: expected a whole number"),
        ({"lanes": 1}, "lanes: unknown parameter of Laned; expected one of lane (did you mean lane?)"),
    ],
)
def test_parameters_that_do_not_fit_are_refused(params, told):
    with pytest.raises(BadInput) as refused:
        _plan("Laned", params=params, **SWARM)
    assert str(refused.value).startswith(f"robot.toml: params.{told}")


def test_the_body_is_the_drivers_unless_the_settings_name_another(tmp_path):
    assert _plan().body.name == "epuck2"
    (tmp_path / "mine.toml").write_text('like = "epuck2"\nmass_kg = 0.2\n')
    plan = _plan(beside=tmp_path, body="mine.toml")
    assert (plan.body.name, plan.body.mass_kg) == ("mine", 0.2)


def test_faults_of_a_sheet_name_the_sheet(tmp_path):
    (tmp_path / "mine.toml").write_text('like = "epuck2"\nmass_kg = -1\n')
    with pytest.raises(BadInput, match=r"mine\.toml: mass_kg: expected more than 0 kg"):
        _plan(beside=tmp_path, body="mine.toml")


def test_the_log_can_tell_which_code_ran():
    assert agent_sha256(_plan().agent) == hashlib.sha256(PLAYERS.read_bytes()).hexdigest()


def test_what_a_worlds_air_tells_is_not_judged_before_it_was_joined():
    medium = {"radio.kind": "world", "network.connect": ["tcp/127.0.0.1:7447"]}
    assert _plan("Ranging", **medium).settings.radio.kind == "world"
    with pytest.raises(BadInput, match="a real radio does not tell: expected tracker = true"):
        _plan("Ranging", **{**medium, "radio.kind": "zenoh"})


ROOT = Path(__file__).parents[4]


def test_those_that_come_along_are_there():
    shipped = tomllib.loads((ROOT / "agent" / "pyproject.toml").read_text("utf-8"))["project"]["entry-points"][GROUP]
    assert set(shipped) <= set(driver_names())
    for name in shipped:
        kind = load_driver(name, "robot.toml", "driver.name")
        assert issubclass(kind, Driver)
        assert f"{kind.__module__}:{kind.__name__}".startswith("swarmwire.agent.drivers.")


def test_an_unknown_one_is_refused_with_those_that_are_there():
    with pytest.raises(BadInput, match=r"robot.toml: driver.name: .*epuck2.*ros2") as refused:
        load_driver("epuck3", "robot.toml", "driver.name")
    assert "epuck3" in str(refused.value)


BODY = load_body("epuck2")  # it has a compass, and no positioning
FOOTBOT = load_body("footbot")


def _offer(
    driver: tuple[str, ...] = ("proximity",), radio: str = "none", tracker: bool = False, body=BODY
) -> Capabilities:
    tells = frozenset(OF_POSES) if radio == "zenoh" and tracker else frozenset[str]()
    return Capabilities(body, "epuck2", frozenset(driver), radio, tells, tracker)


MET = {
    "of the driver": (("proximity",), _offer()),
    "nothing": ((), _offer(())),
    "the compass from the tracker": (("compass",), _offer(tracker=True)),
    "range and bearing from the tracker": (OF_POSES, _offer(radio="zenoh", tracker=True)),
}


@pytest.mark.parametrize("case", MET)
def test_what_is_there_is_taken(case):
    check_needs("Mine", *MET[case], "robot.toml")


UNMET = {
    "ground": (_offer(), "the driver epuck2 does not give (it gives proximity)"),
    "compass": (_offer(), "does not give (it gives proximity): expected tracker = true"),
    "camera": (_offer(), "the body epuck2 lacks: it has proximity"),
    "positioning": (_offer(tracker=True), "the body epuck2 lacks"),
    "radio.range": (_offer(), 'only a radio tells: expected radio.kind "zenoh" or "world"'),
    "radio.bearing": (_offer(radio="zenoh"), "a real radio does not tell: expected tracker = true"),
    "radio.tx_status": (_offer(radio="zenoh", tracker=True), "the radio zenoh does not tell: it tells radio.bearing"),
    "radio.rssi": (_offer(radio="world"), "the radio world does not tell: it tells nothing"),
}


@pytest.mark.parametrize("need", UNMET)
def test_what_is_not_there_is_refused_with_what_would_give_it(need):
    offer, told = UNMET[need]
    with pytest.raises(BadInput) as refused:
        check_needs("Mine", ("proximity", need), offer, "robot.toml")
    assert str(refused.value).startswith(f"robot.toml: agent: Mine needs {need!r}, which ")
    assert told in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_tracker_stands_in_only_for_what_the_driver_does_not_give():
    needs = ("compass", "positioning", "proximity")
    assert tracked(needs, _offer(("compass",), tracker=True)) == {"positioning"}
    assert tracked(needs, _offer(("compass",))) == frozenset()


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
