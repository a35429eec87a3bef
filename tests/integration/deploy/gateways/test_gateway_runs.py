"""Runs with gateways."""

import json
import signal
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from swarmwire.deploy import Recording, Result, Simulation, repeat, run
from swarmwire.deploy.runs.gateways import serving
from tests.support.deploy.runs import ROOT, called
from tests.support.refusals import refused_input
from tests.support.world.gateways import ScriptedGateway

FAST = 100.0  # times real time
BARE = Recording(tables=False, rrd=False)
FOLDER = ROOT / "scenarios" / "robots"
BODIES = ("epuck2", "turtlebot")
SCENARIO = ROOT / "scenarios" / "robots" / "flocking-epuck2.toml"
PROGRAMS = Path(sys.executable).parent


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


def test_summary_names_real_time_and_the_gateways(scenario, scripted, tmp_path) -> None:
    result = driven(scenario, scripted, tmp_path / "run").result
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert (result.mode, result.facts.gateways) == ("realtime", {"other": "scripted"})
    facts = summary["mode"], summary["gateways"], summary["realtime"]["factor"]
    assert facts == ("realtime", {"other": "scripted"}, FAST)
    assert (result.inputs.first_tick, result.inputs.ticks) == (0, 20)


def test_gateway_run_is_repeated_bit_for_bit_without_its_gateways(scenario, scripted, tmp_path) -> None:
    driven(scenario, scripted, tmp_path / "run")
    repetition = repeat(tmp_path / "run")
    assert repetition.same
    assert len(scripted) == 1
    (tmp_path / "run" / "inputs" / "actions.frames").unlink()
    for _ in range(2):
        with refused_input(match="external inputs"):
            repeat(tmp_path / "run")
        (tmp_path / "run" / "summary.json").unlink(missing_ok=True)  # as of a run that was killed


def test_settings_of_each_robot_are_left_in_the_run_folder(scenario, scripted, tmp_path) -> None:
    simulation = driven(scenario, scripted, tmp_path / "run")
    robot = simulation.served.robots[1]
    file = tmp_path / "run" / "robots" / "other-1.toml"
    assert robot.file == file
    settings = tomllib.loads(file.read_text())
    assert settings == robot.settings
    assert settings["robots"] == ["own-0", "own-1", "other-0", "other-1", "other-2"]
    assert settings["driver"] == {"name": "scripted", "address": "scripted:2"}
    assert settings["agent"] == "swarmwire.agent.behaviours:Flocking"
    assert (settings["rate_hz"], settings["pace"]) == (10, FAST)
    networks = [robot.settings["network"] for robot in simulation.served.robots]
    (first,), (second,), (third,) = (network["listen"] for network in networks)
    run = list(simulation.served.endpoints)
    assert [network["connect"] for network in networks] == [run, [*run, first], [*run, first, second]]
    assert len({*run, first, second, third}) == 4
    assert all(at.startswith("tcp/127.0.0.1:") and not at.endswith(":0") for at in (first, second, third))


def test_gateway_run_keeps_its_speed_as_outside_programs_rely_on_it(scenario, scripted) -> None:
    with Simulation(scenario, gateways="scripted", realtime=FAST) as simulation:
        with refused_input():
            simulation.controls.set_speed(2.0 * FAST)
        assert simulation.controls.speed == FAST


def test_dead_robots_are_published_as_dead_to_gateways(scenario, scripted) -> None:
    kill = ["events=[{at_s=0.5, do='kill', robots={group='other', count=1}}]", "duration_s=1"]
    run(scenario, gateways={"other": "scripted"}, realtime=FAST, overrides=kill)
    assert [state.alive.sum() for state in scripted[0].published] == [3] * 5 + [2] * 5


def test_command_line_prints_a_line_for_each_robot_that_can_be_driven(
    scenario, scripted, tmp_path, monkeypatch, capsys
) -> None:
    arguments = ("run", scenario, "--gateway", "other=scripted", "--gateway-set", "first=5", "--realtime=100")
    code, out, _ = called(monkeypatch, capsys, *arguments, "--out", tmp_path / "run", "--no-rrd", "--swarm", "lab")
    assert code == 0
    lines = out.splitlines()
    (line,) = [line for line in lines if line.startswith("other-1")]
    command = ["swarmwire-agent", "run", "--config", str(tmp_path / "run" / "robots" / "other-1.toml")]
    assert line.split() == ["other-1", "scripted", "scripted:6", *command]
    assert any("swarm 'lab': tcp/127.0.0.1:" in line for line in lines)
    assert any("behind gateways: other (scripted)" in line for line in lines)


def test_body_that_differs_from_the_emulated_robot_is_reported_at_the_start(
    scenario, scripted, capsys, monkeypatch
) -> None:
    with Simulation(scenario, gateways={"own": "scripted"}, realtime=FAST):
        lines = capsys.readouterr().err.splitlines()
    assert lines[0].startswith("own: body epuck2 as scripted: no program receives its scan, ")
    monkeypatch.setattr(ScriptedGateway, "differences", lambda _: ())
    with Simulation(scenario, gateways={"own": "scripted"}, realtime=FAST):
        assert "as scripted" not in capsys.readouterr().err


def test_with_a_subtick_it_is_repeated_bit_for_bit_too(scenario, scripted, tmp_path) -> None:
    folder = tmp_path / "run"
    options = {"overrides": ["robots.own.agent=swarmwire.agent.behaviours:Flocking"], "out": folder, "record": BARE}
    in_subticks = Simulation(scenario, gateways={"other": "scripted"}, realtime=10, subtick=0.002, **options)
    with in_subticks as simulation:
        scripted[-1].drive = {1: (0.0, 1.0)}
        simulation.run()
    result = simulation.result
    assert result.realtime.subtick_s == 0.002
    assert sum(result.radio.fates.values()) == result.radio.intended > 0
    repetition = repeat(folder)
    assert repetition.same
    assert repetition.result.radio == result.radio


def shipped(behaviour: str, body: str) -> Result:
    return run(FOLDER / f"{behaviour}-{body}.toml")


def final(result: Result, metric: str) -> float:
    value = result.metrics[metric].final
    assert value is not None, metric
    return value


@pytest.mark.parametrize("body", [*BODIES, "turtlebot4"])
def test_wanderers_touch_nothing(body) -> None:
    result = shipped("avoidance", body)
    assert (final(result, "collisions"), final(result, "wall_contacts")) == (0, 0)
    assert (result.metrics["order"].mean or 0.0) < 0.6


@pytest.mark.parametrize("body", BODIES)
def test_flock_behind_a_gateway_finds_one_heading(body) -> None:
    result = shipped("flocking", body)
    assert (result.metrics["order"].min or 0.0) < 0.8
    assert final(result, "order") > 0.9
    assert final(result, "largest_component") == 1.0
    assert result.radio.link_pdr == pytest.approx(0.9, abs=0.01)


@pytest.mark.parametrize("body", BODIES)
def test_particles_gather_at_the_lamp(body) -> None:
    result = shipped("pso", body)
    assert final(result, "target_best") < 0.3
    assert final(result, "target_mean") < 0.6


@pytest.mark.parametrize("driven", [(), (1,), (0, 1, 2)])
def test_people_are_told_whom_nobody_drives(scenario, scripted, tmp_path, capsys, monkeypatch, driven) -> None:
    monkeypatch.setattr(serving, "GRACE_S", 0.01)  # wall time: the tenth tick
    out = tmp_path / "run"
    with Simulation(scenario, gateways={"other": "scripted"}, realtime=100, out=out, record=BARE) as simulation:
        scripted[-1].drive = dict.fromkeys(driven, (0.0, 0.0))
        simulation.run(15)
        early = [line for line in capsys.readouterr().err.splitlines() if "no program dr" in line]
    late = [line for line in capsys.readouterr().err.splitlines() if "no program dr" in line]
    names = [f"other-{index}" for index in range(3) if index not in driven]
    if not names:
        assert early == late == []
        return
    commands = f"{', '.join(names)}: swarmwire-agent run --config {out}/robots/{names[0]}.toml and so on"
    assert (early, late) == ([f"no program drives {commands}"], [f"no program drove {commands}"])


def test_undriven_robots_are_reported_after_wall_time_not_simulated_time_and_some_named(
    scenario, scripted, capsys
) -> None:
    many = ["robots.other.count=8"]
    with Simulation(scenario, gateways={"other": "scripted"}, realtime=100, overrides=many) as simulation:
        simulation.run(15)
        assert "no program dr" not in capsys.readouterr().err
    (line,) = [line for line in capsys.readouterr().err.splitlines() if "no program dr" in line]
    assert line == "no program drove other-0, other-1, other-2, other-3, other-4, other-5 and 2 more"


def test_robot_that_dies_or_is_revived_comes_to_rest_undriven(scenario, scripted, capsys) -> None:
    events = ["events=[{at_s=0.2, do='kill', robots={group='other'}}, {at_s=0.6, do='revive', robots={group='other'}}]"]
    with Simulation(scenario, gateways={"other": "scripted"}, realtime=100, overrides=events) as simulation:
        for tick in (2, 6):  # as gateways tell it: with the first readings after
            simulation.run(tick)
            scripted[-1].drive = dict.fromkeys(range(3), (0.0, 0.0))
            simulation.run(tick + 1)
    assert "no program drove other-0" in capsys.readouterr().err


def test_printed_command_drives_the_robot(tmp_path) -> None:
    command = [sys.executable, "-m", "swarmwire.deploy", "run", SCENARIO, "--gateway", "epuck2", "--realtime=2"]
    more = ["--set", "robots.flock.count=2", "--out", tmp_path / "run", "--no-rrd"]
    with subprocess.Popen([*command, *more], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as run:
        try:
            line = next(line for line in run.stdout if line.startswith("flock-1"))
            program, *arguments = line.split()[3:]
            assert program == "swarmwire-agent"
            drive = [PROGRAMS / program, *arguments, "--duration-s", "4"]
            agent = subprocess.run(drive, capture_output=True, text=True, timeout=60, check=False)
        finally:
            run.send_signal(signal.SIGINT)
            run.stdout.read()
    assert agent.returncode == 0, agent.stderr
    assert "flock-1: ended (duration)" in agent.stdout
    assert run.returncode == 130
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["ended"] == "interrupted"
    assert summary["radio"]["sent"] > 20, agent.stdout
    assert summary["inputs"]["ticks"] == summary["ticks"]
