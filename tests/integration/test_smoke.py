"""The mission from end to end, with real processes, zenoh, files and sockets: the part of this tier in `make test`."""

import json
import os
import signal

import numpy as np
import polars as pl
import pytest

from swarmwire.agent.drivers.driver import Command
from swarmwire.deploy import Result, RunFolder, run
from tests.support.deploy.runs import LOSSY, ROOT, called, family, runners_of, started
from tests.support.robots.rigs import RIGS

MAIN = ("avoidance", "flocking", "flocking-lossy", "pso", "flocking-disrupted", "flocking-802154")
SHORT = ["duration_s=2"]


@pytest.fixture(scope="module")
def local() -> Result:
    return run(LOSSY, overrides=SHORT)


@pytest.mark.parametrize("runners", [1, 3, "per-robot"])
def test_runners_behind_zenoh_give_the_run_of_one_process(local, runners):
    result = run(LOSSY, overrides=SHORT, runners=runners)
    assert result.trajectory_sha256 == local.trajectory_sha256
    assert (result.radio, result.metrics) == (local.radio, local.metrics)


def test_lossy_radio_gives_each_packet_one_fate_per_receiver(local):
    radio = local.radio
    assert radio is not None
    assert sum(radio.fates.values()) == radio.intended
    decided = radio.fates["received"] + radio.fates["lost"]
    # The scenario loses 30 %; the bound is four standard deviations of a binomial share.
    assert radio.fates["lost"] / decided == pytest.approx(0.3, abs=4 * np.sqrt(0.21 / decided))
    assert radio.latency_air_s.p50 == pytest.approx(0.11, abs=0.02)


@pytest.mark.parametrize("name", MAIN)
def test_main_scenario_runs_from_the_command_line(name, tmp_path, monkeypatch, capsys):
    scenario, folder = ROOT / "scenarios" / f"{name}.toml", tmp_path / "run"
    code, _, errors = called(monkeypatch, capsys, "run", scenario, "--set", "duration_s=1", "--out", folder)
    assert code == 0, errors
    summary = json.loads((folder / "summary.json").read_text())
    assert (summary["ended"], summary["sim_time_s"]) == ("duration", 1.0)
    radio = summary["radio"]
    assert radio is None or sum(radio["fates"].values()) == radio["intended"]


def test_recorded_run_verifies_and_repeats_bit_for_bit(tmp_path, monkeypatch, capsys):
    folder = tmp_path / "run"
    recorded = ("run", LOSSY, "--set", "duration_s=2", "--runners", "2", "--packets", "all", "--out", folder)
    for command in (recorded, ("verify", folder), ("repeat", folder)):
        code, out, errors = called(monkeypatch, capsys, *command)
        assert code == 0, out + errors
    assert RunFolder(folder).ticks()["tick"].to_list() == list(range(20))


def test_sweep_over_loss_shows_lower_delivery(tmp_path, monkeypatch, capsys):
    vary = ["--vary", "radio.loss=0,0.9", "--seeds", "2", "--set", "duration_s=1", "--workers", "2"]
    code, out, errors = called(monkeypatch, capsys, "sweep", LOSSY, *vary, "--out", tmp_path / "losses")
    assert code == 0, out + errors
    rows = pl.read_parquet(tmp_path / "losses" / "summary.parquet")
    pdr = {loss: rows.filter(pl.col("radio.loss") == loss)["radio.link_pdr"].mean() for loss in (0.0, 0.9)}
    assert len(rows) == 4
    assert pdr[0.0] == 1.0
    assert pdr[0.9] == pytest.approx(0.1, abs=0.05)


def test_driver_and_gateway_of_a_robot_communicate():
    rig = RIGS["epuck2"]()
    try:
        rig.connect()
        rig.pop_commands()
        rig.driver.act(Command(0.05, 0.5))
        rig.until_told(0.05, 0.5)
    finally:
        rig.close()


def test_killed_agent_process_costs_its_robots_alone(tmp_path):
    folder = tmp_path / "run"
    dead = ["--set", "run.on_runner_loss='dead'", "--set", "duration_s=2"]
    with started(LOSSY, "--runners", "2", *dead, "--realtime=2", "--out", folder) as process:
        children = family(process)
        os.kill(runners_of(process)[0].pid, signal.SIGKILL)
        process.communicate(timeout=60)
    assert process.returncode == 0
    summary = json.loads((folder / "summary.json").read_text())
    assert (summary["ended"], summary["counts"]["runners_lost"]) == ("duration", 1)
    assert not [child for child in children if child.is_running()]
