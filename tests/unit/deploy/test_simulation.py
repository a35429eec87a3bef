"""A simulation stepped by hand is the run that `run` makes."""

import json
from pathlib import Path

import pytest

from swarmwire.comms.errors import AgentFailed, BadInput
from swarmwire.deploy import Simulation, run
from swarmwire.metrics.run_folder.verify import verify
from tests.support.deploy.commands import LOSSY
from tests.support.deploy.runs import run_spread

SHORT = ["duration_s=2"]


def test_steps_by_hand_make_the_same_run():
    with Simulation(LOSSY, overrides=SHORT) as simulation:
        ticks = [simulation.step().tick for _ in range(simulation.ticks)]
    assert ticks == list(range(20))
    assert simulation.result.ended == "duration"
    assert simulation.result.trajectory_sha256 == run(LOSSY, overrides=SHORT).trajectory_sha256


def test_metrics_can_be_read_between_steps():
    with Simulation(LOSSY, overrides=SHORT) as simulation:
        simulation.run(7)
        order = simulation.metrics.latest["order"][0]
        assert simulation.tick == 7
    assert simulation.result.metrics["order"].final == order


def test_a_run_that_is_left_early_has_a_summary_of_what_there_was(tmp_path):
    with Simulation(LOSSY, overrides=SHORT, out=tmp_path / "run") as simulation:
        simulation.run(5)
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert (summary["ended"], summary["ticks"], summary["error"]) == ("left", 5, None)
    assert sum(summary["radio"]["fates"].values()) == summary["radio"]["intended"]


@pytest.mark.parametrize("runners", [None, 2])
def test_a_run_that_failed_says_why_in_its_summary(tmp_path: Path, runners):
    agent = tmp_path / "bad.py"
    agent.write_text(
        "from swarmwire.agent import Agent\n\nclass Bad(Agent):\n    def step(self, robot):\n"
        "        if robot.time_s > 0.4:\n            raise RuntimeError('no more')\n"
    )
    overrides = [*SHORT, f"robots.flock.agent='{agent}:Bad'", "robots.flock.params={}"]
    with pytest.raises(AgentFailed):
        run_spread(LOSSY, runners, overrides=overrides, out=tmp_path / "run")
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert (summary["ended"], summary["ticks"]) == ("failed", 5)
    assert "no more" in summary["error"]


def test_an_error_of_the_caller_ends_the_run_and_comes_through(tmp_path):
    simulation = Simulation(LOSSY, overrides=SHORT)
    with pytest.raises(ZeroDivisionError), simulation:
        raise ZeroDivisionError
    assert simulation.result.ended == "failed"


def test_it_is_stepped_inside_its_block_only():
    simulation = Simulation(LOSSY, overrides=SHORT)
    with pytest.raises(RuntimeError, match="within its `with` block"):
        simulation.step()
    with pytest.raises(RuntimeError, match="not over yet"):
        _ = simulation.result
    with simulation:
        simulation.step()
    with pytest.raises(RuntimeError, match="within its `with` block"):
        simulation.step()
    with pytest.raises(RuntimeError, match="runs once"):
        simulation.__enter__()


def test_nothing_is_made_of_a_bad_scenario(tmp_path):
    with pytest.raises(BadInput):
        Simulation(LOSSY, overrides=["robots.flock.count=-1"], out=tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_the_folder_of_a_run_that_ended_before_its_first_tick_is_whole(tmp_path):
    with Simulation(LOSSY, overrides=SHORT, out=tmp_path / "run") as simulation:
        pass
    assert simulation.result.ticks == 0
    assert [finding for finding in verify(tmp_path / "run") if not finding.good] == []
