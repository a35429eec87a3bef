"""`swarmwire ctl` beside a run of this process: what it takes, what it hands on, and how it refuses."""

import tomllib

import pytest
from typer.testing import CliRunner

from swarmwire.comms.errors import SwarmwireError
from swarmwire.deploy.cli.app import app
from swarmwire.deploy.cli.ctl_events import selection_of
from tests.support.clocks import until
from tests.support.deploy.runs import going


@pytest.fixture(autouse=True)
def runtime(tmp_path, monkeypatch):
    """A private folder for this test's runs."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))


def ctl(*arguments: object) -> str:
    """What a command prints, in this process; an error of ours is raised as it is."""
    result = CliRunner().invoke(app, ["ctl", *map(str, arguments)], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.output


@pytest.mark.parametrize(
    ("arguments", "place"),
    [
        (["kill", "flok"], "robots.group"),
        (["kill", "flock-99"], "robots.names"),
        (["kill", "3", "4"], "ROBOTS"),
        (["kill", "3x"], "ROBOTS"),
        (["jam", "--at", "-1,0"], "do"),
        (["jam", "--at", "here"], "--at"),
        (["set", "loss"], "KEY=VALUE"),
        (["set", "loss=2"], "to"),
        (["set", "los=0.2"], "what"),
        (["speed", "fast"], "FACTOR"),
        (["event", "kill"], "event"),
        (["event", "3"], "event"),
        (["event", '{ do = "kil" }'], "do"),
        (["end", "7"], "event"),
        (["partition"], "between, region, halves"),
        (["--run", "nowhere", "pause"], "nowhere"),
        (["--ca", "ca.pem", "pause"], "--endpoint"),
        (["--endpoint", "tcp/192.0.2.1:7447", "pause"], "beyond this machine"),
    ],
)
def test_faults_are_told_in_one_line(going_run, arguments, place):
    with pytest.raises(SwarmwireError, match="^[^\n]*$") as caught:
        ctl(*arguments)
    assert place in str(caught.value)


@pytest.fixture
def going_run(tmp_path):
    """A run of this process that is announced as those of the command line are."""
    from swarmwire.deploy.control.run_finder import Announced

    with going(tmp_path / "run", "duration_s=1", observers=[Announced(tmp_path / "run")]) as found:
        until(lambda: list((tmp_path / "swarmwire").glob("*.json")))
        yield found


def test_a_word_that_is_no_command_is_refused_with_the_one_that_was_meant():
    for arguments in (["pasue"], ["pasue", "3"]):
        result = CliRunner().invoke(app, ["ctl", *arguments])
        assert result.exit_code == 2
        assert "Did you mean 'pause'?" in result.output


def test_an_event_is_any_table_of_a_scenario(going_run):
    table = '{ do = "fail", part = "motors", robots = { count = 3 }, for_s = 10 }'
    assert "event 0: fail" in ctl("event", table)
    simulation, control = going_run
    [event] = control.status()["events"]
    assert event["text"] == 'fail part = "motors", robots = { count = 3 }, for_s = 10.0'
    assert tomllib.loads(f"event = {table}")["event"] == dict(simulation.live_events._waiting[0][1])


@pytest.mark.parametrize(
    "command", ["status", "pause", "step", "speed", "kill", "impulse", "partition", "jam", "set", "event"]
)
def test_the_help_of_each_command_has_an_example(command):
    assert f"swarmwire ctl {command}" in ctl(command, "--help").replace("swarmwire ctl --run 3f2a", "swarmwire ctl")


def test_robots_are_named_drawn_or_all():
    assert selection_of(["flock-1,flock-2"]) == {"names": ["flock-1", "flock-2"]}
    assert selection_of(["flock"]) == {"group": "flock"}
    assert selection_of(["4"]) == {"count": 4}
    assert selection_of(["flock", "12.5%"]) == {"group": "flock", "share": 0.125}
