"""Runs with robots behind a gateway: what programs tell them is done, recorded, told in the summary and repeated."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.deploy import Recording, Simulation, repeat, run
from tests.support.deploy.commands import called
from tests.support.world.gateways.scripted import ScriptedGateway

FAST = 100.0  # times real time
BARE = Recording(tables=False, rrd=False)


def driven(scenario: Path, scripted: list[ScriptedGateway], out: Path | None) -> Simulation:
    """A run of which robot other-1 is told to turn on the spot from the fifth tick on, and own-* act by themselves."""
    simulation = Simulation(scenario, gateways={"other": "scripted"}, realtime=FAST, out=out, record=BARE)
    with simulation:
        simulation.run(5)
        scripted[-1].drive = {1: (0.0, 1.0)}
        simulation.run()
    return simulation


def test_robots_do_what_programs_tell_them_and_others_what_their_agents_decide(scenario, scripted) -> None:
    with Simulation(scenario, gateways={"other": "scripted"}, realtime=FAST) as simulation:
        before = simulation.world.pose.copy()
        scripted[0].drive = {1: (0.0, 1.0)}
        simulation.run(10)
        after = simulation.world.pose
        turned = np.mod(after[:, 2] - before[:, 2], 2 * np.pi)
        assert turned[3] == pytest.approx(1.0, abs=0.1)
        assert turned[[2, 4]].max() == 0.0
        assert np.hypot(*(after - before)[:2, :2].T).min() > 0.01
        assert len(scripted[0].published) == 10


def test_the_summary_says_that_it_was_real_time_and_which_gateways_there_were(scenario, scripted, tmp_path) -> None:
    result = driven(scenario, scripted, tmp_path / "run").result
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert (result.mode, result.facts.gateways) == ("realtime", {"other": "scripted"})
    assert (summary["mode"], summary["gateways"], summary["realtime"]["factor"]) == (
        "realtime",
        {"other": "scripted"},
        FAST,
    )
    assert result.inputs is not None
    assert (result.inputs.first_tick, result.inputs.ticks) == (0, 20)


def test_it_is_repeated_bit_for_bit_without_its_gateways(scenario, scripted, tmp_path) -> None:
    driven(scenario, scripted, tmp_path / "run")
    repetition = repeat(tmp_path / "run")
    assert repetition.same
    assert len(scripted) == 1
    (tmp_path / "run" / "inputs" / "actions.frames").unlink()
    with pytest.raises(BadInput):
        repeat(tmp_path / "run")


def test_one_that_was_killed_cannot_be_repeated_without_what_programs_told(scenario, scripted, tmp_path) -> None:
    driven(scenario, scripted, tmp_path / "run")
    (tmp_path / "run" / "inputs" / "actions.frames").unlink()
    (tmp_path / "run" / "summary.json").unlink()
    with pytest.raises(BadInput, match="came from outside"):
        repeat(tmp_path / "run")


def test_settings_of_each_robot_are_left_in_the_run_folder(scenario, scripted, tmp_path) -> None:
    simulation = driven(scenario, scripted, tmp_path / "run")
    assert simulation.served is not None
    robot = simulation.served.robots[1]
    file = tmp_path / "run" / "robots" / "other-1.toml"
    assert robot.file == file
    settings = tomllib.loads(file.read_text())
    assert settings == robot.settings
    assert settings["robots"] == ["own-0", "own-1", "other-0", "other-1", "other-2"]
    assert settings["driver"] == {"name": "scripted", "address": "scripted:2"}
    assert (settings["agent"], settings["rate_hz"], settings["pace"]) == (
        "swarmwire.agent.behaviours:Flocking",
        10,
        FAST,
    )
    networks = [robot.settings["network"] for robot in simulation.served.robots]
    (first,), (second,), (third,) = (network["listen"] for network in networks)
    run = list(simulation.served.endpoints)
    assert [network["connect"] for network in networks] == [run, [*run, first], [*run, first, second]]
    assert len({*run, first, second, third}) == 4
    assert all(at.startswith("tcp/127.0.0.1:") and not at.endswith(":0") for at in (first, second, third))


def test_its_speed_stays_whatever_people_press_since_programs_elsewhere_keep_to_it(scenario, scripted) -> None:
    with Simulation(scenario, gateways="scripted", realtime=FAST) as simulation:
        simulation.controls.faster()
        simulation.controls.slower()
        assert simulation.controls.speed == FAST


def test_the_dead_are_told_as_dead(scenario, scripted) -> None:
    kill = ["events=[{at_s=0.5, do='kill', robots={group='other', count=1}}]", "duration_s=1"]
    run(scenario, gateways={"other": "scripted"}, realtime=FAST, overrides=kill)
    assert [told.alive.sum() for told in scripted[0].published] == [3] * 5 + [2] * 5


def test_the_command_line_prints_a_line_for_each_robot_that_can_be_driven(
    scenario, scripted, tmp_path, monkeypatch, capsys
) -> None:
    arguments = ("run", scenario, "--gateway", "other=scripted", "--gateway-set", "first=5", "--realtime=100")
    code, out, _ = called(monkeypatch, capsys, *arguments, "--out", tmp_path / "run", "--no-rrd", "--swarm", "lab")
    assert code == 0
    lines = out.splitlines()
    (line,) = [line for line in lines if line.startswith("other-1")]
    assert line.split() == [
        *("other-1", "scripted", "scripted:6", "swarmwire-agent", "run", "--config"),
        str(tmp_path / "run" / "robots" / "other-1.toml"),
    ]
    assert any("swarm 'lab': tcp/127.0.0.1:" in line for line in lines)
    assert any("behind gateways: other (scripted)" in line for line in lines)


def test_a_body_that_is_another_robot_than_its_gateway_emulates_is_told_of_at_the_start(
    scenario, scripted, capsys, monkeypatch
) -> None:
    with Simulation(scenario, gateways={"own": "scripted"}, realtime=FAST):
        told = capsys.readouterr().err.splitlines()
    assert told[0].startswith("own: body epuck2 as scripted: nobody is told its scan, ")
    monkeypatch.setattr(ScriptedGateway, "differences", lambda _: ())
    with Simulation(scenario, gateways={"own": "scripted"}, realtime=FAST):
        assert "as scripted" not in capsys.readouterr().err


def test_with_a_subtick_it_is_repeated_bit_for_bit_too(scenario, scripted, tmp_path) -> None:
    folder = tmp_path / "run"
    both_flock = ["robots.own.agent=swarmwire.agent.behaviours:Flocking"]
    in_subticks = Simulation(
        scenario,
        overrides=both_flock,
        gateways={"other": "scripted"},
        realtime=10,
        subtick=0.002,
        out=folder,
        record=BARE,
    )
    with in_subticks as simulation:
        scripted[-1].drive = {1: (0.0, 1.0)}
        simulation.run()
    result = simulation.result
    assert result.realtime is not None
    assert result.realtime.subtick_s == 0.002
    assert result.radio is not None
    assert sum(result.radio.fates.values()) == result.radio.intended > 0
    repetition = repeat(folder)
    assert repetition.same
    assert repetition.result.radio == result.radio
