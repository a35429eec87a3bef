"""Bad input is refused before anything starts: one line with file and key, exit code 2, no traceback."""

import re
from dataclasses import fields
from typing import get_type_hints

import pytest

from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy import run
from swarmwire.deploy.robots.certificates.folder import begin_authority
from swarmwire.deploy.runs.config import RunConfig, RunOptions
from swarmwire.world.scenario_file import load_scenario
from tests.support.deploy.certificates import DatedFakeClock
from tests.support.deploy.runs import LOSSY, called, refused_command

NEEDY = """
from swarmwire.agent import Agent, Robot

class Needy(Agent):
    needs = ("positioning",)
    def step(self, robot: Robot) -> None: ...

class Rssi(Agent):
    needs = ("radio.rssi",)
    def step(self, robot: Robot) -> None: ...
"""
LANE_AGENTS = """
from swarmwire.agent import Agent, PerRobot, Robot, Robots, Memory, VectorAgent

class Lanes(VectorAgent):
    lane: PerRobot[int]
    def step(self, robots: Robots, memory: Memory) -> None: ...

class Lone(Agent):
    lane: PerRobot[int]
    def step(self, robot: Robot) -> None: ...
"""
THREE = "robots.flock={body='epuck', count=3, agent="
REFUSED = [  # a setting, and the key that the line names; all keys of scenarios are tested in world/scenario
    ("robots.flock.count=0", "robots.flock.count"),
    ("physics.steps=1", "physics.steps"),
    ("robots.flock.place.radius_m=0.1", "robots.flock.place"),
    ("robots.flock.params.separation=1", "robots.flock.params.separation"),
    ("robots.flock.agent='flocking'", "robots.flock.agent"),
    (f"{THREE}'needy.py:Needy'}}", "robots.flock.agent"),
    (f"{THREE}'needy.py:Rssi'}}", "robots.flock.agent"),
    (f"{THREE}'lanes.py:Lanes'}}", "robots.flock.params.lane"),
    (f"{THREE}'lanes.py:Lanes', params={{lane=[1, 2]}}}}", "robots.flock.params.lane"),
    (f"{THREE}'lanes.py:Lanes', params={{lane=[1, 2, 0.5]}}}}", "robots.flock.params.lane"),
    (f"{THREE}'lanes.py:Lone'}}", "robots.flock.agent"),
    ("radio.measures={}", "robots.flock.agent"),
    ("events=[{at_s=1, do='kill', robots={group='flok'}}]", "events.0.robots.group"),
]


@pytest.fixture
def agents(tmp_path):
    (tmp_path / "lanes.py").write_text(LANE_AGENTS)
    (tmp_path / "needy.py").write_text(NEEDY)
    scenario = tmp_path / "scenario.toml"
    scenario.write_text(LOSSY.read_text())
    return scenario


def refused(scenario: object, *settings: str, **options: object) -> BadInput:
    """How a run is refused, which is a line."""
    with pytest.raises(BadInput) as error:
        run(scenario, overrides=list(settings), **options)
    assert "\n" not in str(error.value)
    return error.value


@pytest.mark.parametrize(("setting", "key"), REFUSED)
def test_bad_value_is_refused_with_its_file_or_option_and_key(agents, setting, key):
    error = refused(agents, setting)
    assert error.key == key
    assert error.where in (str(agents), f"--set {setting}")


@pytest.mark.parametrize(
    ("words", "where"),
    [
        (f"check {LOSSY} --set robots.flock.place.radius_m=0.1", f"{LOSSY}: robots.flock.place: "),
        (f"check {LOSSY} --set nonsense", "--set nonsense: "),
        (f"check {LOSSY} --set duration_s=inf", "--set duration_s=inf: duration_s: "),
        (f"check {LOSSY} --set radio={{}}", "--set radio={}: radio.range_m: is missing"),
        (f"check {LOSSY} --set radio.measures={{}}", f"{LOSSY}: robots.flock.agent: "),
        (f"run {LOSSY} --set robots.flock.count=many", "--set robots.flock.count=many: robots.flock.count: "),
        (f"run {LOSSY} --seeds 9:1", "--seeds: "),
        (f"run {LOSSY} --runners all", "--runners: "),
        (f"run {LOSSY} --realtime -2", "--realtime: "),
        ("run absent.toml", "absent.toml: "),
        (f"run {'x' * 300}", f"{'x' * 300}: "),
        ("list nothing", "nothing: expected one of "),
        ("describe flokking", "flokking: nothing has this name; nearest: Flocking"),
        ("export absent --to film.gif", "absent: "),
        ("certs issue absent a", "absent: expected a CA's folder: swarmwire certs init absent"),
        ("certs issue ca a/b", "NAME: "),
        ("radio probe unit-disk", "--contention: "),
        ("ctl pause", "expected a live run: "),
    ],
)
def test_command_with_bad_input_prints_one_line_and_exits_with_2(words, where, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    begin_authority(tmp_path / "ca", DatedFakeClock("2026-06-01T12:00:00Z"))
    refused_command(monkeypatch, capsys, *words.split(), match=re.escape(where))
    assert not (tmp_path / "runs").exists()


@pytest.mark.parametrize("command", ["check", "draw"])
def test_folder_of_a_swarm_stands_for_its_scenario(command, agents, monkeypatch, capsys):
    monkeypatch.chdir(agents.parent)
    assert called(monkeypatch, capsys, command, ".")[0] == 0
    monkeypatch.chdir("/")
    refused_command(monkeypatch, capsys, command, agents.parent / "absent")


def test_radio_event_without_a_radio_is_refused(agents):
    text = agents.read_text()
    agents.write_text(text[: text.index("[radio]")])
    events = "events=[{at_s=1, do='blackout', robots={count=1}}]"
    error = refused(agents, events)
    assert (error.where, error.key) == (f"--set {events}", "events.0.do")
    assert refused(agents).key == "robots.flock.agent"


def test_check_tells_of_events_that_come_too_late(monkeypatch, capsys):
    setting = "events=[{at_s=1.9, do='kill', robots={count=1}}, {at_s=1.95, do='kill', robots={count=1}}]"
    code, out, _ = called(monkeypatch, capsys, "check", LOSSY, "--set", setting, "--set", "duration_s=2")
    assert code == 0
    assert out.endswith(": events.1\n")


def test_files_that_are_no_scenario_are_named(tmp_path):
    assert refused(tmp_path / "absent.toml").where == str(tmp_path / "absent.toml")
    bad = tmp_path / "bad.toml"
    bad.write_text("robots = [")
    assert refused(bad).where == str(bad)


@pytest.mark.parametrize(
    ("options", "name"),
    [*(({"runners": runners}, "runners") for runners in (0, 21, "many", True)), ({"seeds": [1, 1]}, "seeds")],
)
def test_option_that_cannot_be_is_refused_by_its_name(options, name):
    error = refused(LOSSY, **options)
    assert name in (error.where, error.key)


def test_misspelt_option_of_a_run_is_a_type_error_that_suggests_the_right_one():
    with pytest.raises(TypeError, match=r"'sede'.* seed \(did you mean this\?\)"):
        run(LOSSY, sede=3)


def test_option_beside_a_run_config_is_a_type_error():
    with pytest.raises(TypeError, match="seed"):
        run(RunConfig(LOSSY), seed=3)


def test_option_types_of_a_run_are_those_of_its_config():
    options = {option.name: option.type for option in fields(RunConfig) if option.kw_only}
    assert get_type_hints(RunOptions) == {name: get_type_hints(RunConfig)[name] for name in options}


def test_misspelt_group_of_an_override_suggests_the_right_one():
    assert "flock (did you mean this?)" in refused(LOSSY, "robots.flok.count=2").expected
    assert "existing group" not in refused(LOSSY, "robots.flock.count=0").expected


def test_overrides_are_of_a_file():
    assert "Scenario" in refused(load_scenario(LOSSY), "seed=2").expected


def test_out_folder_that_is_not_empty_is_refused(tmp_path):
    (tmp_path / "kept").touch()
    for folder in (tmp_path, tmp_path / "kept" / "run"):
        error = refused(LOSSY, out=folder)
        assert (error.where, error.key) == ("out", str(folder))
