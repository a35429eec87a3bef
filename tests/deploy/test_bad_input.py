"""Bad input is refused at the door: one line with file, key and what was expected, exit code 2, no traceback."""

import socket

import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.deploy import run
from tests.deploy.commands import LOSSY, swarmwire

AGENTS = """
import no_such_module_anywhere
"""
NEEDY = """
from swarmwire.agent import Agent, Robot

class Needy(Agent):
    needs = ("positioning",)
    def step(self, robot: Robot) -> None: ...

class Rssi(Agent):
    needs = ("radio.rssi",)
    def step(self, robot: Robot) -> None: ...

class Lazy(Agent):
    pass

class Strict(Agent):
    level: int
    def step(self, robot: Robot) -> None: ...

helper = 3
"""
FLOCK = "robots.flock"


@pytest.fixture
def agents(tmp_path):
    (tmp_path / "broken.py").write_text(AGENTS)
    (tmp_path / "needy.py").write_text(NEEDY)
    scenario = tmp_path / "scenario.toml"
    scenario.write_text(LOSSY.read_text())
    return scenario


def refused(scenario, *settings, **options) -> str:
    with pytest.raises(BadInput) as error:
        run(scenario, overrides=list(settings), **options)
    text = str(error.value)
    assert "\n" not in text
    return text


@pytest.mark.parametrize(
    ("setting", "key", "expected"),
    [
        ("robots.flock.cuont=3", "robots.flock.cuont", "unknown key"),
        ("rdio={}", "rdio", "unknown key"),
        ("robots.flock.count='x'", "robots.flock.count", "whole number"),
        ("robots.flock.count=0", "robots.flock.count", "at least 1"),
        ("radio.loss=1.5", "radio.loss", "at most 1"),
        ("radio.range_m=-1", "radio.range_m", "above 0"),
        ("radio.model='fog'", "radio.model", "disk"),
        ("radio.send_offset='sometimes'", "radio.send_offset", "uniform"),
        ("radio.send_offset=-0.1", "radio.send_offset", "from 0 to"),
        ("duration_s=0", "duration_s", "above 0"),
        ("format=2", "format", "1"),
        ("physics.steps=1", "physics.steps", "2"),
        ("robots.flock.body='blimp'", "robots.flock.body", "epuck"),
        ("robots.flock.place.radius_m=0.1", "robots.flock", "room"),
        ("robots.flock.params.separation=1", "robots.flock.params.separation", "separation_m"),
        ("robots.flock.params.separation_m='far'", "robots.flock.params.separation_m", "a number"),
        ("robots.flock.agent='nowhere.at.all:X'", "robots.flock.agent", "does not import"),
        ("robots.flock.agent='swarmwire.agent.behaviours:Dance'", "robots.flock.agent", "Dance"),
        ("robots.flock.agent='flocking'", "robots.flock.agent", "module:Class"),
        ("robots.flock.agent='math:pi'", "robots.flock.agent", "no Agent"),
        ("robots.flock.agent='absent.py:X'", "robots.flock.agent", "there is no file"),
        ("robots.flock.agent='broken.py:X'", "robots.flock.agent", "no_such_module_anywhere"),
        ("robots.flock.agent='needy.py:helper'", "robots.flock.agent", "no Agent"),
        ("robots.flock.agent='needy.py:Lazy'", "robots.flock.agent", "no step method"),
        ("robots.flock={body='epuck', count=3, agent='needy.py:Strict'}", "robots.flock.params.level", "is missing"),
        ("robots.flock={body='epuck', count=3, agent='needy.py:Needy'}", "robots.flock.agent", "lacks"),
        ("robots.flock={body='epuck', count=3, agent='needy.py:Rssi'}", "robots.flock.agent", "radio does not tell"),
        ("radio.gives={}", "robots.flock.agent", "radio.range"),
    ],
)
def test_a_bad_value_is_named_with_its_key_and_what_was_expected(agents, setting, key, expected):
    text = refused(agents, setting)
    assert key in text
    assert expected in text
    assert "scenario.toml" in text or "--set" in text


def test_files_that_are_no_scenario_are_named(tmp_path):
    assert "absent.toml" in refused(tmp_path / "absent.toml")
    bad = tmp_path / "bad.toml"
    bad.write_text("robots = [")
    assert "bad.toml" in refused(bad)


@pytest.mark.parametrize("runners", [0, 21, "many", True])
def test_a_number_of_runners_that_cannot_be_is_refused(runners):
    assert "per-robot" in refused(LOSSY, runners=runners)


def test_seeds_must_be_different_and_not_negative():
    for seeds in ([], [1, 1], [-1]):
        assert "seeds" in refused(LOSSY, seeds=seeds)
    assert "seed" in refused(LOSSY, seed=1, seeds=[2])


def test_a_folder_that_holds_something_is_refused(tmp_path):
    (tmp_path / "kept").touch()
    assert "new or empty" in refused(LOSSY, out=tmp_path)
    assert "can be made" in refused(LOSSY, out=tmp_path / "kept" / "run")


def test_a_socket_in_use_or_of_no_use_is_refused(tmp_path):
    assert "a directory that exists" in refused(LOSSY, runners=1, socket=tmp_path / "absent" / "s")
    assert "at most 107" in refused(LOSSY, runners=1, socket=tmp_path / ("s" * 110))
    taken = tmp_path / "s"
    taken.mkdir()
    assert "free" in refused(LOSSY, runners=1, socket=taken)


def test_a_stale_socket_is_taken_over(tmp_path):
    stale = tmp_path / "s"
    with socket.socket(socket.AF_UNIX) as dead:
        dead.bind(str(stale))
    result = run(LOSSY, overrides=["duration_s=0.5"], runners=1, socket=stale)
    assert result.ticks == 5


@pytest.mark.parametrize(
    "arguments",
    [
        ["run", LOSSY, "--set", "robots.flock.count=many"],
        ["run", LOSSY, "--seeds", "9:1"],
        ["run", LOSSY, "--runners", "all"],
        ["run", "absent.toml"],
        ["check", LOSSY, "--set", "nonsense"],
    ],
)
def test_the_command_says_one_line_and_exits_with_2(arguments, tmp_path):
    ended = swarmwire(*arguments, cwd=tmp_path)
    assert (ended.returncode, ended.stdout) == (2, "")
    assert ended.stderr.startswith("error: ")
    assert ended.stderr.count("\n") == 1
    assert not (tmp_path / "runs").exists()


def test_a_path_that_holds_something_is_not_touched(tmp_path):
    notes = tmp_path / "notes.txt"
    notes.write_text("mine")
    assert "something else is there" in refused(LOSSY, runners=1, socket=notes)
    assert notes.read_text() == "mine"
    with socket.socket(socket.AF_UNIX) as busy:
        busy.bind(str(tmp_path / "busy"))
        busy.listen()
        assert "in use" in refused(LOSSY, runners=1, socket=tmp_path / "busy")
        assert (tmp_path / "busy").is_socket()


@pytest.mark.parametrize(
    ("setting", "expected"),
    [
        ("robots.flock.params.separation_m=nan", "finite"),
        ("robots.flock.params.separation_m=99999999999999999999", "64 bits"),
        ("radio.bit_rate_bps=1000000000000000000000", "at most 1000000000000"),
        ("radio.queue_limit=1000000000000000000000", "at most 1000000"),
    ],
)
def test_numbers_that_nothing_could_work_with_are_refused(setting, expected):
    assert expected in refused(LOSSY, setting)


def test_needs_that_are_no_names_are_refused(tmp_path):
    for needs in ("None", "(3,)", '"proximity"'):
        agent = tmp_path / f"odd{len(needs)}.py"
        agent.write_text(f"{NEEDY}\nclass Odd(Needy):\n    needs = {needs}\n")
        assert "a tuple of texts" in refused(LOSSY, f"robots.flock.agent={agent}:Odd", "robots.flock.params={}")
