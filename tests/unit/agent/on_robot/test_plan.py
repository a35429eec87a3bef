import hashlib
from pathlib import Path
from typing import Any

import pytest

from swarmwire.agent.on_robot.mind import Mind, group_of
from swarmwire.agent.on_robot.plan import Plan, agent_sha256, plan_of
from swarmwire.agent.on_robot.settings_file import read_settings
from swarmwire.comms.errors import BadInput
from swarmwire.comms.outcomes import NO_OUTCOMES
from swarmwire.comms.packets import Heard
from tests.support.agent.on_robot.scripted import PLAYERS, DatedFakeClock


def _plan(agent: str = "Driving", beside: Path | None = None, **more: Any) -> Plan:
    """The plan of an e-puck2; nothing is connected."""
    flags = {"agent": f"{PLAYERS}:{agent}", "driver.name": "epuck2", "driver.address": "10.0.0.1", **more}
    file = None
    if beside:
        file = beside / "robot.toml"
        file.write_text("format = 1\n")
    settings = read_settings(file, {key: (key, value) for key, value in flags.items()})
    return plan_of(settings, "robot.toml", DatedFakeClock())


SWARM = {"robots": ["flock-0", "flock-1", "flock-2"], "name": "flock-1"}


def test_of_a_list_with_a_value_for_each_robot_a_robot_has_its_own():
    plan = _plan("Laned", params={"lane": [3, 4, 5]}, **SWARM)
    assert plan.params == {"lane": 4}
    settings = plan.settings
    group = group_of(settings.name, settings.index, settings.agent, plan.params, plan.body, seed=1)
    mind = Mind(group, 10, None, plan.limits)
    assert mind.step(0, {}, Heard.none(), NO_OUTCOMES).command.linear_mps == pytest.approx(0.04)


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
    air = {"radio.kind": "air", "network.connect": ["tcp/127.0.0.1:7447"]}
    assert _plan("Ranging", **air).settings.radio.kind == "air"
    with pytest.raises(BadInput, match="a real radio does not tell: expected tracker = true"):
        _plan("Ranging", **{**air, "radio.kind": "zenoh"})
