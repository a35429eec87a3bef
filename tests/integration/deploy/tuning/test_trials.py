"""Trials run a scenario with what is searched; those that fail are told, and the best is a scenario of its own."""

import shutil

import polars as pl
import pytest

from swarmwire.deploy import run
from swarmwire.deploy.tuning.run import NothingFound
from tests.support.deploy.tuning import AT, gone_on_with, trials_in, tuned

pytestmark = pytest.mark.usefixtures("here")


def test_the_best_is_a_scenario_that_runs_from_the_folder_alone(tmp_path, scenario):
    found = tuned(
        scenario, tmp_path / "t", AT, "robots.pair.count=2:4", trials=6, seeds=1, overrides=("duration_s=0.3",)
    )
    shutil.rmtree(tmp_path / "t" / "scenario")
    for file in ("bowl.py", "careful.py", "bowl.toml"):
        (tmp_path / file).unlink()
    result = run(tmp_path / "t" / "best.toml")
    assert (result.ticks, result.arenas[0].seed) == (3, 7)
    assert result.metrics["bowl"].final == found.best.result.value
    assert result.robots == found.best.parameters["robots.pair.count"]


def test_trials_that_fail_are_told_of_and_never_the_best(tmp_path, scenario):
    searched = ("robots.pair.params.speed=0:1", AT)
    found = tuned(scenario, tmp_path / "t", *searched, trials=8, seeds=1)
    rows = trials_in(tmp_path / "t")
    too_fast = pl.col("robots.pair.params.speed") > 0.5
    failed, complete = rows.filter(too_fast), rows.filter(~too_fast)
    assert len(failed)
    assert len(complete)
    assert set(failed["state"]) == {"failed"}
    assert set(failed["failed"]) == {1}
    assert failed["value"].null_count() == len(failed)
    assert all("ValueError: too fast" in error for error in failed["error"])
    assert set(complete["state"]) == {"complete"}
    assert found.best.parameters["robots.pair.params.speed"] <= 0.5


def test_where_all_trials_fail_it_ends_in_a_line(tmp_path, scenario):
    with pytest.raises(NothingFound, match="all 3 trials failed.*too fast") as ended:
        tuned(scenario, tmp_path / "t", "robots.pair.params.speed=0.6:1", trials=3)
    assert "\n" not in str(ended.value)
    assert not (tmp_path / "t" / "best.toml").exists()


def test_where_values_are_no_good_together_that_trial_fails(tmp_path, scenario):
    searched = ("robots.pair.count=2,60", "arena.size_m=[4.0, 4.0],[0.3, 0.3]")
    found = tuned(scenario, tmp_path / "t", *searched, trials=6, seeds=1, sampler="random")
    rows = trials_in(tmp_path / "t")
    crowded = (pl.col("robots.pair.count") == "60") & (pl.col("arena.size_m") == "[0.3, 0.3]")
    assert set(rows.filter(crowded)["state"]) == {"failed"}
    assert set(rows.filter(~crowded)["state"]) == {"complete"}
    assert found.is_over


def test_choices_may_be_files_which_the_folder_keeps(tmp_path, scenario):
    (tmp_path / "other.py").write_text((tmp_path / "careful.py").read_text())
    searched = "robots.pair.agent=careful.py:Careful,other.py:Careful"
    tuned(scenario, tmp_path / "t", searched, trials=2, seeds=1, until=1, parallel_trials=1, sampler="random")
    for file in ("careful.py", "other.py", "bowl.py"):
        (tmp_path / file).unlink()
    found = gone_on_with(tmp_path / "t", trials=5)
    assert set(trials_in(tmp_path / "t")["robots.pair.agent"]) == {"careful.py:Careful", "other.py:Careful"}
    assert run(tmp_path / "t" / "best.toml").ended == "duration"
    assert found.is_over
