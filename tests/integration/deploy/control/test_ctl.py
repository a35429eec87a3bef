"""`swarmwire ctl` in a terminal beside a run: it finds it, says how it is, changes it, and tells faults in one line."""

import json
from typing import Any

import pytest
from typer.testing import CliRunner

from swarmwire.comms.errors import BadInput
from swarmwire.deploy import repeat
from swarmwire.deploy.cli.app import app
from swarmwire.deploy.live.following import read_live
from swarmwire.metrics.run_folder.layout import LIVE_EVENTS
from tests.support.deploy.commands import LOSSY, started
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
    return json.loads(ctl(*(("--run", *run) if run else ()), "status", "--json"))


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
    assert "event 0: kill" in ctl("kill", "flock-1", "flock-4")
    assert "event 1: ramp" in ctl("set", "loss=0.7")
    ctl("partition", "x", "--for", 1)
    ctl("impulse", "flock", "20%", "--speed", 0.5, "--direction", 1.57)
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
    assert ctl("status").startswith("no run ")
    assert len((tmp_path / "run" / LIVE_EVENTS).read_text().splitlines()) == 5
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
    with pytest.raises(BadInput):
        ctl("pause")


def test_of_several_runs_there_is_a_table(tmp_path, process):
    with started(LOSSY, "--set", "duration_s=100000", "--out", tmp_path / "other") as other:
        until(lambda: read_live(tmp_path / "other"))
        lines = ctl("status").splitlines()
        assert len(lines) == 3
        assert lines[0].split() == ["run", "scenario", "tick", "state", "speed", "alive", "folder"]
        assert len(ctl("status", "--json").splitlines()) == 2
        with pytest.raises(BadInput, match="several"):
            ctl("pause")
        ctl("--run", tmp_path / "other", "stop")
        other.communicate()
