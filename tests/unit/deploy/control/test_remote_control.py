"""A run is controlled from elsewhere: it stands still, goes on by ticks, and takes events, which are on record."""

import json

import pytest

from swarmwire.deploy import repeat, run
from swarmwire.deploy.control.remote_control import Refused
from swarmwire.deploy.live.following import Live, read_live
from swarmwire.metrics.run_folder.layout import LIVE_EVENTS
from tests.support.clocks import until
from tests.support.deploy.commands import LOSSY
from tests.support.deploy.runs import at_tick, going

SHORT = "duration_s=5"
KILL = {"do": "kill", "robots": {"names": ["flock-1", "flock-2"]}}


def lines(folder):
    return [json.loads(line) for line in (folder / LIVE_EVENTS).read_text().splitlines()]


def test_paused_means_that_the_tick_stands_still_and_steps_are_so_many_ticks(tmp_path):
    with going(tmp_path / "run", SHORT) as (simulation, control):
        assert control.pause()["done"] == "paused"
        assert control.status()["state"] == "paused"
        control.step(3)
        assert at_tick(control, 3)["state"] == "paused"
        control.step(2)
        control.step()
        at_tick(control, 6)
        paused = {control.status()["tick"] for _ in range(20)}
        assert paused == {6}
        control.resume()
        until(lambda: simulation.tick > 6)
    assert simulation.result.ended == "duration"


def test_pause_step_and_speed_do_not_change_the_run(tmp_path):
    with going(tmp_path / "run", SHORT) as (simulation, control):
        control.step(4)
        at_tick(control, 4)
        assert "100 times" in control.speed(100)["done"]
        assert control.status()["speed"] == 100.0
        control.resume()
        until(control.status, lambda status: status["tick"] >= 10)
        control.pause()
        control.speed(None)
    assert simulation.result.trajectory_sha256 == run(LOSSY, overrides=[SHORT]).trajectory_sha256
    assert not (tmp_path / "run" / LIVE_EVENTS).exists()
    assert simulation.result.live_events is None


def test_an_event_takes_effect_at_the_next_tick_and_is_on_record_before(tmp_path):
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
    told = [(event.tick, event.do, event.ended, event.at_s) for event in simulation.result.events]
    assert told == [(3, "kill", False, 0.3), (5, "ramp", False, 0.5), (6, "kill", True, 0.3), (6, "ramp", True, 0.5)]


@pytest.mark.parametrize(
    ("table", "line"),
    [
        ({"do": "burn"}, "do: "),
        ({"do": "kill", "robots": {"names": ["x-1"]}}, "robots.names: "),
        ({"do": "jammer", "at": [0, 0], "power_dbm": 3.0}, "do: expected a radio"),
    ],
)
def test_what_is_refused_is_told_in_the_runs_own_line_and_the_run_goes_on(tmp_path, table, line):
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


def test_in_real_time_there_is_no_speed_without_a_limit(tmp_path):
    with going(tmp_path / "run", "duration_s=1", realtime=5) as (simulation, control):
        assert control.status()["real_time"]
        with pytest.raises(Refused, match="wall clock"):
            control.speed(None)
        assert "50 times" in control.speed(50)["done"]
    assert simulation.result.realtime is not None


def test_a_run_is_stopped_with_its_summary(tmp_path):
    with going(tmp_path / "run", "duration_s=1000") as (simulation, control):
        control.step(2)
        at_tick(control, 2)
        control.stop()
    assert (simulation.result.ended, simulation.result.ticks) == ("interrupted", 2)


SIGNALS = ["radio={preset='ieee802154', measures={range={}, bearing={}}}", SHORT]


def test_a_jammer_put_up_and_taken_down_is_repeated(tmp_path):
    with going(tmp_path / "run", *SIGNALS) as (simulation, control):
        control.step(3)
        at_tick(control, 3)
        jammer = control.event({"do": "jammer", "at": [0.0, 0.0], "power_dbm": 10.0})
        control.step(10)
        at_tick(control, 13)
        control.end(jammer)
    radio = simulation.result.radio
    assert radio is not None
    assert radio.fates["jammed"] > 0
    assert repeat(tmp_path / "run").same


def test_a_published_run_says_where_it_is(tmp_path):
    with going(tmp_path / "run", SHORT) as (simulation, _):
        live = read_live(tmp_path / "run")
    assert isinstance(live, Live)
    assert live.run == simulation.run_id
