"""Live control of a run, with and without certificates."""

import json
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.base.errors import BadInput, SwarmwireError
from swarmwire.comms.wire.access_control import observers_access
from swarmwire.comms.wire.keys import ObserverKeys
from swarmwire.comms.wire.sessions import closed_after, listens_at, open_observed
from swarmwire.deploy import Simulation, repeat, run
from swarmwire.deploy.cli.app import app
from swarmwire.deploy.live import remote_control
from swarmwire.deploy.live.remote_control import RemoteControl, controlling, only_run_at
from swarmwire.deploy.live.subscription import RunGone
from swarmwire.deploy.robots.certificates.folder import begin_authority, issue
from swarmwire.deploy.robots.certificates.member import member
from swarmwire.deploy.robots.certificates.register import certificate_request
from swarmwire.deploy.runs.control_server import ControlServer, Status
from swarmwire.deploy.runs.controls import Controls
from swarmwire.deploy.runs.live_address import Announcement, read_live
from swarmwire.metrics.measures.measure import Metrics
from swarmwire.metrics.records.run_folder.layout import LIVE_EVENTS
from swarmwire.metrics.records.run_folder.reader import RunFolder
from tests.support.clocks import until
from tests.support.deploy.runs import LOSSY, at_tick, going, started
from tests.support.metrics.truths import static

SHORT = "duration_s=5"
KILL = {"do": "kill", "robots": {"names": ["flock-1", "flock-2"]}}


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


def test_ctl_finds_changes_and_kills_in_a_run_that_is_repeated(tmp_path, process):
    ctl("pause")
    now = until(status, lambda status: status["state"] == "paused")
    tick = now["tick"]
    assert status(now["run"][:5])["run"] == status(tmp_path / "run")["run"] == now["run"]
    assert now["folder"] == str(tmp_path / "run")
    assert "event 0: kill" in ctl("kill", "flock-1", "flock-4")
    assert "event 1: ramp" in ctl("set", "loss=0.7")
    ctl("partition", "x", "--for", 1)
    ctl("impulse", "flock", "20%", "--speed", 0.5, "--direction", 1.57)
    assert "(to come)" in ctl("status")
    ctl("step", 20)
    now = until(status, lambda status: status["state"] == "paused" and status["tick"] > tick)
    assert (now["tick"], now["alive"], now["radio"]["loss"]) == (tick + 20, 18, 0.7)
    assert "event 0 ends" in ctl("end", 0)
    ctl("step", 5)
    until(status, lambda status: status["state"] == "paused" and status["tick"] == tick + 25)
    output = ctl("status")
    assert "20 of 20 alive" in output
    assert "2 ready, 0 lost" in output
    process.kill()
    process.communicate()
    assert ctl("status").startswith("no run ")
    assert len((tmp_path / "run" / LIVE_EVENTS).read_text().splitlines()) == 5
    repetition = repeat(tmp_path / "run")
    assert repetition.same
    assert repetition.compared == tick + 25


def test_ctl_status_of_several_runs_is_a_table(tmp_path):
    with ExitStack() as stack:
        for name in ("run", "other"):
            observers = [Announcement(tmp_path / name)]
            stack.enter_context(going(tmp_path / name, SHORT, observers=observers))
        until(lambda: len(ctl("status", "--json").splitlines()) == 2)  # a busy machine answers late
        lines = ctl("status").splitlines()
        assert len(lines) == 3
        assert lines[0].split() == ["run", "pid", "scenario", "tick", "state", "speed", "alive", "folder"]
        with pytest.raises(BadInput, match="several"):
            ctl("pause")
        ctl("--run", tmp_path / "other", "stop")
        until(lambda: len(ctl("status", "--json").splitlines()) == 1)


def test_status_has_the_progress_of_a_run(tmp_path):
    with going(tmp_path / "run", SHORT, runners=2) as (simulation, control):
        control.step(2)
        at_tick(control, 2)
        status = control.status()
        facts = {"run": simulation.run_id, "seeds": [1], "tick": 2, "ticks": 50, "time_s": 0.2, "real_time": False}
        facts |= {"alive": 20, "robots": 20, "groups": {"flock": 20}, "events": []}
        assert {name: status[name] for name in facts} == facts
        assert status["robot_names"][7] == "flock-7"
        assert (status["runners"]["ready"], status["counts"]["nan_commands"]) == (2, 0)
        assert (status["radio"]["loss"], status["radio"]["measures.range.noise_m"]) == (0.3, 0.02)
        assert 0.0 <= status["metrics"]["order"] <= 1.0
        control.step()
        assert at_tick(control, 3)["measures_ms"] > 0.0


def _is_gone(control: RemoteControl) -> bool:
    try:
        control.status()
    except RunGone:
        return True
    return False


def test_nobody_answers_for_a_run_that_is_over(tmp_path):
    with going(tmp_path / "run", "duration_s=1") as (simulation, control):
        live = read_live(tmp_path / "run")
        assert only_run_at(live.endpoint) == simulation.run_id
        control.stop()
        until(lambda: read_live(tmp_path / "run") is None)
        until(lambda: _is_gone(control))  # the endpoint closes a moment after the file says so
    with pytest.raises(RunGone, match="cannot be reached"), controlling(live.endpoint, live.run):
        pass
    with pytest.raises(RunGone, match="cannot be reached"):
        only_run_at(live.endpoint)


def session_of_people(control: RemoteControl) -> None:
    """Kill, part and unite, set, push and jam, at several ticks."""
    control.step(5)
    at_tick(control, 5)
    control.event({"do": "kill", "robots": {"count": 3}, "for_s": 2.0})
    parted = control.event({"do": "partition", "halves": "x"})
    control.step(7)
    at_tick(control, 12)
    control.event({"do": "ramp", "what": "radio.loss", "to": 0.6})
    control.event({"do": "impulse", "robots": {"share": 0.3}, "speed_mps": 0.6, "direction_rad": 1.0})
    control.event({"do": "fail", "part": "motors", "robots": {"group": "flock"}, "per_hour": 1000.0, "for_s": 1.0})
    control.step(4)
    at_tick(control, 16)
    control.end(parted)
    control.event({"do": "ramp", "what": "radio.loss", "to": 0.2})
    control.event({"do": "ramp", "what": "radio.range_m", "to": 1.0, "over_s": 1.0})
    control.step(3)
    at_tick(control, 19)
    control.event({"do": "revive", "robots": {"group": "flock"}})


def test_interactive_session_is_repeated_bit_for_bit_in_another_layout(tmp_path):
    with going(tmp_path / "run", SHORT) as (simulation, control):
        session_of_people(control)
    result = simulation.result
    assert result.live_events.lines == 9 + 1  # and the loss that was set before ends
    assert result.trajectory_sha256 != run(LOSSY, overrides=[SHORT]).trajectory_sha256
    repetition = repeat(tmp_path / "run", runners=3, out=tmp_path / "again")
    assert repetition.same
    assert repetition.changes == ()
    assert repetition.result.live_events == result.live_events
    assert (repetition.result.events, repetition.result.radio) == (result.events, result.radio)
    assert repeat(tmp_path / "again").same


def test_interactive_session_in_real_time_is_repeated(tmp_path):
    with going(tmp_path / "run", "duration_s=3", realtime=20, runners=2) as (simulation, control):
        session_of_people(control)
        control.speed(100)
    assert simulation.result.inputs is not None
    repetition = repeat(tmp_path / "run")
    assert repetition.same
    assert repetition.result.events == simulation.result.events


def test_live_events_from_python_are_repeated_and_an_altered_record_noticed(tmp_path):
    with Simulation(LOSSY, overrides=[SHORT], out=tmp_path / "run") as simulation:
        simulation.run(5)
        number = simulation.apply_event(KILL)
        simulation.run(9)
        simulation.live_events.end(number)
        simulation.run()
    assert repeat(tmp_path / "run").same
    rows = RunFolder(tmp_path / "run").events().select("tick", "do", "ended").rows()
    assert rows == [(5, "kill", False), (9, "kill", True)]
    path = tmp_path / "run" / LIVE_EVENTS
    path.write_text(path.read_text().replace("flock-2", "flock-3"))
    repetition = repeat(tmp_path / "run")
    assert (repetition.same, repetition.first_difference) == (False, 5)
    assert repetition.changes == (f"{LIVE_EVENTS} is not as the run left it: its sha256 differs",)


@pytest.fixture(scope="module")
def certs(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("lab") / "ca"
    begin_authority(folder, WallClock())
    names = "world", "operator", "observer", "runner"
    issue(folder, [certificate_request(name, ["127.0.0.1"], name) for name in names], 2, WallClock())
    return folder


@pytest.fixture
def controls() -> Controls:
    return Controls(WallClock(), 10)


@pytest.fixture
def endpoint(certs, controls) -> Iterator[str]:
    """Where the run `r`, which takes nothing but what controls know, is controlled from elsewhere."""
    keys, world = ObserverKeys("r"), member("world", certs=certs)
    names = {"run_id": "r", "scenario": "s", "ticks": 9}
    callbacks = {"health": lambda: None, "counts": dict, "radio": lambda: None, "events": list}
    status = Status(metrics=Metrics(), controls=controls, clock=WallClock(), **names, **callbacks)
    status.begin(static(2))
    assert world.access is not None
    opened = open_observed("tls/127.0.0.1:0", world.network, observers_access(keys, world.access))
    with closed_after(opened) as session:
        server = ControlServer(status, controls, lambda _: 0, lambda _: None, lambda _: None).declare(session, keys)
        token = session.liveliness().declare_token(keys.published)
        yield listens_at(session)[0]
        del server, token


def test_operator_controls_a_run_and_an_observer_only_looks(certs, controls, endpoint, monkeypatch):
    monkeypatch.setattr(remote_control, "ANSWER_TIMEOUT_S", 3.0)
    operator = member("operator", certs=certs).network
    with controlling(endpoint, only_run_at(endpoint, operator), operator) as control:
        assert (control.status()["run"], control.pause()["done"]) == ("r", "paused")
    assert controls.paused
    observer = member("observer", certs=certs).network
    with controlling(endpoint, only_run_at(endpoint, observer), observer) as control:
        assert control.status()["ticks"] == 9
        with pytest.raises(RunGone, match="no answer"):
            control.resume()
    assert controls.paused
    runner = member("runner", certs=certs).network
    with controlling(endpoint, "r", runner) as control:
        for ask in (control.status, control.resume):
            with pytest.raises(RunGone, match="no answer"):
                ask()
    assert controls.paused
    with pytest.raises(RunGone, match="found none"):
        only_run_at(endpoint, runner)


def test_certificate_of_another_authority_is_named_as_a_possible_cause(tmp_path, endpoint):
    begin_authority(tmp_path / "ca", WallClock())
    issue(tmp_path / "ca", [certificate_request("operator", [], "operator")], 2, WallClock())
    with pytest.raises(RunGone, match="cannot be reached.*certificate"):
        only_run_at(endpoint, member("operator", certs=tmp_path / "ca").network)


def test_ctl_takes_a_folder_of_certificates(certs, controls, endpoint):
    elsewhere = ("--endpoint", endpoint, "--certs", certs)
    assert ctl(*elsewhere, "--name", "operator", "step", 3).startswith("3 ticks")
    assert "tick      0 of 9" in ctl("--run", "r", *elsewhere, "status")
    with pytest.raises(SwarmwireError, match="--endpoint: expected --certs with"):
        ctl("--endpoint", endpoint, "status")
