"""`swarmwire ctl` in a terminal beside a run: it finds it, says how it is, changes it, and tells faults in one line."""

import json
import tomllib
from typing import Any

import pytest
from typer.testing import CliRunner

from swarmwire.comms.errors import BadInput, SwarmwireError
from swarmwire.deploy import repeat
from swarmwire.deploy.cli import app
from swarmwire.deploy.commands.ctl.selection import selection_of
from swarmwire.deploy.live.live_file import read_live
from swarmwire.metrics.record.names import INTERVENTIONS
from tests.support.deploy.commands import LOSSY, started
from tests.support.deploy.control.going import going
from tests.support.waiting import until


@pytest.fixture(autouse=True)
def runtime(tmp_path, monkeypatch):
    """A private folder for this test's runs."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))


def ctl(*arguments: object) -> str:
    """What a command prints, in this process; an error of ours is raised as it is."""
    result = CliRunner().invoke(app, ["ctl", *map(str, arguments)], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.output


def status(*run: object) -> dict[str, Any]:
    return json.loads(ctl(*run, "status", "--json"))


@pytest.fixture
def process(tmp_path):
    """A long run of the command line."""
    with started(LOSSY, "--set", "duration_s=100000", "--out", tmp_path / "run", "--runners", "2") as process:
        until(lambda: read_live(tmp_path / "run"))
        yield process
        process.kill()


def test_a_run_in_another_process_is_found_changed_killed_and_repeated(tmp_path, process):
    ctl("pause")
    now = until(status, lambda status: status["state"] == "paused")
    tick = now["tick"]
    assert status(now["run"][:5])["run"] == status(tmp_path / "run")["run"] == now["run"]
    assert now["folder"] == str(tmp_path / "run")
    assert "event 0: kill, from the next tick on" in ctl("kill", "flock-1", "flock-4")
    assert "event 1: ramp" in ctl("set", "loss=0.7")
    ctl("partition", "x", "--for", 1)
    ctl("push", "flock", "20%", "--speed", 0.5, "--direction", 1.57)
    assert "to come" in ctl("events")
    ctl("step", 20)
    now = until(status, lambda status: status["state"] == "paused" and status["tick"] > tick)
    assert (now["tick"], now["alive"], now["radio"]["loss"]) == (tick + 20, 18, 0.7)
    assert "event 0 ends" in ctl("end", 0)
    ctl("step", 5)
    until(status, lambda status: status["state"] == "paused" and status["tick"] == tick + 25)
    told = ctl("status")
    assert "20 of 20 alive" in told
    assert "2 ready, 0 lost" in told
    process.kill()
    process.communicate()
    assert ctl("status") == "no run of yours goes on on this machine\n"
    assert len((tmp_path / "run" / INTERVENTIONS).read_text().splitlines()) == 5
    repetition = repeat(tmp_path / "run")
    assert repetition.same
    assert repetition.compared == tick + 25


def test_speed_resume_and_stop_end_a_run_with_its_summary(tmp_path, process):
    assert "5 times real time" in ctl("speed", 5)
    assert "as fast as possible" in ctl("speed", "max")
    ctl("pause")
    ctl("resume")
    ctl("stop")
    process.communicate()
    assert (tmp_path / "run" / "summary.json").exists()
    with pytest.raises(BadInput, match="expected a run that goes on: this machine has none of yours"):
        ctl("pause")


def test_of_several_runs_there_is_a_table(tmp_path, process):
    with started(LOSSY, "--set", "duration_s=100000", "--out", tmp_path / "other") as other:
        until(lambda: read_live(tmp_path / "other"))
        lines = ctl("status").splitlines()
        assert len(lines) == 3
        assert lines[0].split() == ["run", "scenario", "tick", "state", "speed", "alive", "folder"]
        assert len(ctl("status", "--json").splitlines()) == 2
        with pytest.raises(BadInput, match="several runs go on"):
            ctl("pause")
        ctl(tmp_path / "other", "stop")
        other.communicate()


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["kill", "flok"], "robots.group: expected one of flock"),
        (["kill", "flock-99"], "robots.names: expected names of robots"),
        (["kill", "3", "4"], "ROBOTS: expected names such as flock-3"),
        (["kill", "3x"], "ROBOTS: expected a number such as 5"),
        (["jam", "--at", "-1,0"], "do: expected a radio with signals"),
        (["jam", "--at", "here"], "--at: expected two numbers such as 1.5,-2; got 'here'"),
        (["set", "loss"], "KEY=VALUE: expected a number for a key"),
        (["set", "loss=2"], "to: expected at most 1, got 2.0 for radio.loss"),
        (["set", "los=0.2"], "what: unknown key radio.los"),
        (["speed", "fast"], "FACTOR: expected a number such as 0.5, or max"),
        (["event", "kill"], "event: expected a TOML table on one line"),
        (["event", "3"], "event: expected a table with do"),
        (["event", '{ do = "kil" }'], "do: expected one of blackout"),
        (["end", "7"], "event: expected an event: there is none, got 7"),
        (["partition"], "expected one of between, region, halves"),
        (["nowhere", "pause"], "nowhere: expected one of"),
        (["--ca", "ca.pem", "pause"], "--endpoint: is missing"),
        (["--endpoint", "tcp/192.0.2.1:7447", "pause"], "reaches beyond this machine"),
    ],
)
def test_faults_are_told_in_one_line(going_run, arguments, line):
    with pytest.raises(SwarmwireError, match="^[^\n]*$") as caught:
        ctl(*arguments)
    assert line in str(caught.value)


@pytest.fixture
def going_run(tmp_path):
    """A run of this process that is announced as those of the command line are."""
    from swarmwire.deploy.control.run_finder import Announced

    with going(tmp_path / "run", "duration_s=1", observers=[Announced(tmp_path / "run")]) as found:
        until(lambda: list((tmp_path / "swarmwire").glob("*.json")))
        yield found


def test_a_word_that_is_neither_run_nor_command_is_told_with_what_was_meant():
    for arguments in (["pasue"], ["pasue", "3"]):
        result = CliRunner().invoke(app, ["ctl", *arguments])
        assert result.exit_code == 2
        assert "expected one of status, pause" in " ".join(result.output.replace("│", " ").split())


def test_an_event_is_any_table_of_a_scenario(going_run):
    table = '{ do = "fail", part = "motors", robots = { count = 3 }, for_s = 10 }'
    assert "event 0: fail" in ctl("event", table)
    simulation, control = going_run
    [event] = control.status()["events"]
    assert event["text"] == 'fail part = "motors", robots = { count = 3 }, for_s = 10.0'
    assert tomllib.loads(f"event = {table}")["event"] == dict(simulation.interventions._waiting[0][1])


@pytest.mark.parametrize(
    "command", ["status", "pause", "step", "speed", "kill", "push", "partition", "jam", "set", "event"]
)
def test_the_help_of_each_command_has_an_example(command):
    assert f"swarmwire ctl {command}" in ctl(command, "--help").replace("swarmwire ctl 3f2a", "swarmwire ctl")


def test_robots_are_named_drawn_or_all():
    assert selection_of(["flock-1,flock-2"]) == {"names": ["flock-1", "flock-2"]}
    assert selection_of(["flock"]) == {"group": "flock"}
    assert selection_of(["4"]) == {"count": 4}
    assert selection_of(["flock", "12.5%"]) == {"group": "flock", "share": 0.125}
