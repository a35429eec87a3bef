"""A run is found on this machine, and controlled from elsewhere: pauses, ticks and events, which are on record."""

import json
import os
import tomllib

import pytest
from typer.testing import CliRunner

from swarmwire.comms.base.errors import SwarmwireError
from swarmwire.deploy import repeat
from swarmwire.deploy.cli.actions.inject import robot_selection
from swarmwire.deploy.cli.app import app
from swarmwire.deploy.live.remote_control import Refused
from swarmwire.deploy.runs import live_address
from swarmwire.deploy.runs.live_address import Announcement, Live, LiveRun, find_run, live_runs, runs_folder, write_live
from swarmwire.metrics.records.run_folder.layout import LIVE_EVENTS
from tests.support.clocks import until
from tests.support.deploy.runs import at_tick, going
from tests.support.metrics.truths import static
from tests.support.refusals import refused_input

NOBODY = 2**22 + 1  # more than Linux gives out


@pytest.fixture(autouse=True)
def runtime(tmp_path, monkeypatch):
    """A private folder for this test's runs."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    return tmp_path / "swarmwire"


def announced(folder, run, pid=None):
    """A run that is announced, as far as files go."""
    folder.mkdir()
    write_live(Live("unixsock-stream//nowhere", run, pid or os.getpid()), folder)
    announcement = Announcement(folder)
    announcement.begin(static(2))
    return announcement


def test_run_is_found_until_it_ends(tmp_path, runtime):
    assert live_runs() == []
    run = announced(tmp_path / "a", "r1")
    [live] = live_runs()
    assert live == LiveRun("unixsock-stream//nowhere", "r1", os.getpid(), static(2).name, str(tmp_path / "a"))
    assert find_run(None) == find_run("r1") == find_run("r") == live
    assert find_run(str(tmp_path / "a")).run == "r1"
    assert run.end(None) == {}
    assert live_runs() == []
    assert list(runtime.iterdir()) == []


def test_killed_runs_and_files_that_are_no_run_are_removed(tmp_path, runtime):
    folder = runs_folder()
    killed = LiveRun("e", "r1", NOBODY, "s", "f")
    (folder / "r1.json").write_text(json.dumps(vars(killed)))
    (folder / "r2.json").write_text("[]")
    (folder / ".aside-r3.json").write_text("")
    assert live_runs() == []
    assert [path.name for path in runtime.iterdir()] == [".aside-r3.json"]


def test_run_name_that_fits_none_or_several_runs_is_refused(tmp_path):
    with refused_input(match="none"):
        find_run(None)
    for name in ("aa1", "ab2"):
        announced(tmp_path / name, name)
    assert find_run("ab").run == "ab2"
    (tmp_path / "empty").mkdir()
    for name, match in (
        (None, r"several.* aa1 \(.*\), ab2 \("),
        ("a", "several.* aa1 .*ab2"),
        ("b", "aa1, ab2"),
        (str(tmp_path / "empty"), "empty: expected the folder of a live run"),
    ):
        with refused_input(match=match):
            find_run(name)


def test_runtime_folder_open_to_others_or_linked_is_refused(tmp_path, runtime):
    assert runs_folder().stat().st_mode & 0o777 == 0o700
    runtime.chmod(0o755)
    with refused_input(match="closed to others"):
        runs_folder()
    runtime.rmdir()
    (tmp_path / "elsewhere").mkdir(mode=0o700)
    runtime.symlink_to(tmp_path / "elsewhere")
    with refused_input(match="that is the user's"):
        runs_folder()


def test_without_a_runtime_folder_it_is_one_among_the_temporary_files(tmp_path, monkeypatch):
    monkeypatch.delenv("XDG_RUNTIME_DIR")
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    assert runs_folder() == tmp_path / f"swarmwire-{os.getuid()}"


def test_runtime_folder_of_another_user_is_passed_over(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setattr("os.getuid", lambda: tmp_path.stat().st_uid + 1)
    assert live_address._belongs_to_user(tmp_path) is False
    with refused_input(match=f"swarmwire-{os.getuid()}"):  # which is of another user here, too
        runs_folder()


SHORT = "duration_s=5"
KILL = {"do": "kill", "robots": {"names": ["flock-1", "flock-2"]}}


def lines(folder):
    return [json.loads(line) for line in (folder / LIVE_EVENTS).read_text().splitlines()]


def test_live_event_takes_effect_next_tick_and_is_recorded_before(tmp_path):
    with going(tmp_path / "run", SHORT) as (simulation, control):
        control.step(3)
        at_tick(control, 3)
        number = control.event(KILL)
        assert number == 0
        assert [event["tick"] for event in control.status()["events"]] == [None]
        assert not (tmp_path / "run" / LIVE_EVENTS).exists()
        control.step(2)
        status = at_tick(control, 5)
        assert lines(tmp_path / "run") == [{"tick": 3, "number": 0, "event": KILL}]
        assert status["alive"] == 18
        expected = 'kill robots = { names = ["flock-1", "flock-2"] }'
        assert status["events"] == [
            {"number": 0, "tick": 3, "do": "kill", "text": expected, "over": False, "given": True}
        ]
        loss = control.event({"do": "ramp", "what": "radio.loss", "to": 1.0})
        control.step()
        assert at_tick(control, 6)["radio"]["loss"] == 1.0
        control.end(loss)
        control.end(number)
        control.step()
        status = at_tick(control, 7)
        assert (status["alive"], status["radio"]["loss"]) == (20, 0.3)
        assert all(event["over"] for event in status["events"])
    assert lines(tmp_path / "run")[2:] == [{"tick": 6, "number": 1, "end": True}, {"tick": 6, "number": 0, "end": True}]
    events = [(event.tick, event.do, event.ended, event.at_s) for event in simulation.result.events]
    assert events == [(3, "kill", False, 0.3), (5, "ramp", False, 0.5), (6, "kill", True, 0.3), (6, "ramp", True, 0.5)]
    assert repeat(tmp_path / "run").same


@pytest.mark.parametrize(
    ("table", "line"),
    [
        ({"do": "burn"}, "do: "),
        ({"do": "kill", "robots": {"names": ["x-1"]}}, "robots.names: "),
        ({"do": "jammer", "at": [0, 0], "power_dbm": 3.0}, "do: expected a radio"),
    ],
)
def test_refused_requests_get_one_line_and_leave_the_run_going(tmp_path, table, line):
    with going(tmp_path / "run", SHORT) as (simulation, control):
        with pytest.raises(Refused, match="^[^\n]*$") as caught:
            control.event(table)
        assert str(caught.value).startswith(line)
        for ask in (lambda: control.end(0), lambda: control.step(0), lambda: control.speed(-1.0)):
            with pytest.raises(Refused, match="expected"):
                ask()
        control._session.put(control._keys.control, b"no request")  # nobody takes it
    assert simulation.result.ended == "duration"
    assert simulation.result.live_events is None


def ctl(*arguments: object) -> str:
    """What a command prints, in this process; an error of ours is raised as it is."""
    result = CliRunner().invoke(app, ["ctl", *map(str, arguments)], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.output


@pytest.mark.parametrize(
    ("arguments", "where"),
    [
        (["kill", "3", "4"], "ROBOTS"),
        (["kill", "3x"], "ROBOTS"),
        (["jam", "--at", "-1,0"], "do"),
        (["jam", "--at", "here"], "--at"),
        (["set", "loss"], "KEY=VALUE"),
        (["set", "loss=2"], "to"),
        (["speed", "fast"], "FACTOR"),
        (["event", "kill"], "event"),
        (["event", "3"], "event"),
        (["end", "7"], "event"),
        (["partition"], "between, region, halves"),
        (["--run", "nowhere", "pause"], "nowhere"),
        (["--certs", "ca", "pause"], "--endpoint"),
        (["--endpoint", "tcp/192.0.2.1:7447", "pause"], "beyond this machine"),
    ],
)
def test_faults_are_told_in_one_line(going_run, arguments, where):
    with pytest.raises(SwarmwireError, match="^[^\n]*$") as caught:
        ctl(*arguments)
    assert where in str(caught.value)


@pytest.fixture
def going_run(tmp_path):
    """A run of this process that is announced as those of the command line are."""
    with going(tmp_path / "run", "duration_s=1", observers=[Announcement(tmp_path / "run")]) as run:
        until(lambda: list((tmp_path / "swarmwire").glob("*.json")))
        yield run


def test_misspelt_command_is_refused_with_the_right_one():
    for arguments in (["pasue"], ["pasue", "3"]):
        result = CliRunner().invoke(app, ["ctl", *arguments])
        assert result.exit_code == 2
        assert "Did you mean 'pause'?" in result.output


def test_event_command_takes_any_event_table_of_a_scenario(going_run):
    table = '{ do = "fail", part = "motors", robots = { count = 3 }, for_s = 10 }'
    assert "event 0: fail" in ctl("event", table)
    simulation, control = going_run
    [event] = control.status()["events"]
    assert event["text"] == 'fail part = "motors", robots = { count = 3 }, for_s = 10.0'
    assert tomllib.loads(f"event = {table}")["event"] == dict(simulation.live_events._waiting[0][1])


def test_robots_are_named_drawn_or_all():
    assert robot_selection(["flock-1,flock-2"]) == {"names": ["flock-1", "flock-2"]}
    assert robot_selection(["flock"]) == {"group": "flock"}
    assert robot_selection(["4"]) == {"count": 4}
    assert robot_selection(["flock", "12.5%"]) == {"group": "flock", "share": 0.125}
