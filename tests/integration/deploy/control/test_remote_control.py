"""A run whose robots are in other processes is controlled and repeated; one that is over answers nobody."""

import pytest

from swarmwire.deploy import Simulation, repeat, run
from swarmwire.deploy.control.remote_control import RemoteControl, controlling, only_run_at
from swarmwire.deploy.live.following import RunGone, read_live
from swarmwire.metrics.run_folder.layout import LIVE_EVENTS
from swarmwire.metrics.run_folder.reader import RunFolder
from tests.support.deploy.commands import LOSSY
from tests.support.deploy.control.going import at_tick, going
from tests.support.waiting import until

SHORT = "duration_s=5"
KILL = {"do": "kill", "robots": {"names": ["flock-1", "flock-2"]}}


def test_the_status_tells_how_the_run_is_doing(tmp_path):
    with going(tmp_path / "run", SHORT, runners=2) as (simulation, control):
        control.step(2)
        at_tick(control, 2)
        status = control.status()
        assert status["run"] == simulation.run_id
        assert (status["scenario"], status["seeds"]) == ("flocking over a lossy radio", [1])
        assert (status["tick"], status["ticks"], status["time_s"]) == (2, 50, 0.2)
        assert (status["alive"], status["robots"], status["groups"]) == (20, 20, {"flock": 20})
        assert status["robot_names"][7] == "flock-7"
        assert status["runners"]["ready"] == 2
        assert (status["radio"]["loss"], status["radio"]["measures.range.noise_m"]) == (0.3, 0.02)
        assert 0.0 <= status["metrics"]["order"] <= 1.0
        assert status["counts"]["nan_commands"] == 0
        assert status["events"] == []
        assert not status["real_time"]
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
        assert live is not None
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


@pytest.mark.parametrize(("then", "now"), [(None, 3), (3, None)])
def test_an_interactive_session_is_repeated_bit_for_bit_in_whatever_layout(tmp_path, then, now):
    with going(tmp_path / "run", SHORT, runners=then) as (simulation, control):
        session_of_people(control)
    result = simulation.result
    assert result.live_events is not None
    assert result.live_events.lines == 9 + 1  # and the loss that was set before ends
    assert result.trajectory_sha256 != run(LOSSY, overrides=[SHORT]).trajectory_sha256
    repetition = repeat(tmp_path / "run", runners=now, out=tmp_path / "again")
    assert repetition.same
    assert repetition.changes == ()
    assert repetition.result.live_events == result.live_events
    assert (repetition.result.events, repetition.result.radio) == (result.events, result.radio)
    assert repeat(tmp_path / "again").same


def test_an_interactive_session_in_real_time_is_repeated(tmp_path):
    with going(tmp_path / "run", "duration_s=3", realtime=20, runners=2) as (simulation, control):
        session_of_people(control)
        control.speed(100)
    assert simulation.result.inputs is not None
    repetition = repeat(tmp_path / "run")
    assert repetition.same
    assert repetition.result.events == simulation.result.events


def test_what_people_did_from_python_and_an_altered_record_are_noticed(tmp_path):
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
