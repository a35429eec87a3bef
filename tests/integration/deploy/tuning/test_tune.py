"""Tuning: from Python, by the command line, gone on with, and killed."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys

import numpy as np
import polars as pl
import psutil
import pytest

from swarmwire.deploy import run
from swarmwire.deploy.campaigns.sweep import NoObserver
from swarmwire.deploy.campaigns.tuning.best import gained
from swarmwire.deploy.campaigns.tuning.study import FILE
from swarmwire.deploy.cli.actions import tune
from swarmwire.metrics.records.campaign.folder import CampaignFolder
from tests.support.deploy.runs import ROOT, called, refused_command
from tests.support.deploy.tuning import AT, gone_on_with, scenario_in, trials_in, tuned
from tests.support.refusals import refused_input

GOAL = ("--goal", "min bowl")
KILLED = """
import sys
from pathlib import Path
from swarmwire.deploy.campaigns.sweep import NoObserver
from swarmwire.deploy.runs.controls import Interrupt
from swarmwire.deploy.campaigns.tuning.run import TuneObservers, begin_tune
from tests.support.deploy.tuning import plan_of
class Watcher:
    def begin(self, tuning, trials): print("begins", flush=True)
    def see(self, trial): print("trial", flush=True)
    def end(self): pass
plan = plan_of(Path(sys.argv[1]), seeds=1, trials=5, parallel_trials=2)
begin_tune(plan, Path(sys.argv[2]), "", 1, TuneObservers(Watcher(), NoObserver(), Interrupt()))
"""


@pytest.mark.usefixtures("calculated")
def test_known_optimum_is_found(tmp_path, scenario):
    result = tuned(scenario, tmp_path / "t", trials=24, seeds=1)
    assert result.is_over
    assert result.best.parameters["metrics.0.at"] == pytest.approx(0.7, abs=0.05)
    rows = trials_in(tmp_path / "t")
    assert rows["trial"].to_list() == list(range(24))
    assert np.allclose(rows["value"], (rows["metrics.0.at"] - 0.7) ** 2)
    assert result.best.number == rows["value"].arg_min()
    assert set(rows["state"]) == {"complete"}


@pytest.mark.usefixtures("calculated")
def test_best_trial_is_checked_on_seeds_that_no_trial_had(tmp_path, scenario):
    result = tuned(scenario, tmp_path / "t", trials=4, seeds=3, check_seeds="5")
    names = ("baseline", f"trial-{result.best.number}")
    own, best = (CampaignFolder(tmp_path / "t" / "check" / name) for name in names)
    assert own.about.seeds == best.about.seeds == (4, 5, 6, 7, 8)
    assert own.sample("bowl", 0).value == pytest.approx([0.36] * 5)
    assert set(best.sample("bowl", 0).value) == {result.best.result.value}
    statistic, difference, interval = gained(result.check, result.tuning.goal)
    assert (statistic, difference) == ("medians", pytest.approx(result.best.result.value - 0.36))
    assert interval.low == interval.high == pytest.approx(difference)


@pytest.mark.usefixtures("calculated")
@pytest.mark.parametrize("until", [1, 4, 6])
def test_ended_anywhere_and_gone_on_with_it_is_as_in_one_go(tmp_path, scenario, until):
    tuned(scenario, tmp_path / "whole", seeds=1)
    ended = tuned(scenario, tmp_path / "t", seeds=1, until=until)
    assert (ended.is_over, until <= len(ended.trials) < 10) == (False, True)
    again = gone_on_with(tmp_path / "t")
    assert again.is_over
    assert trials_in(tmp_path / "t").equals(trials_in(tmp_path / "whole"), null_equal=True)
    assert (tmp_path / "t" / "best.toml").read_text() == (tmp_path / "whole" / "best.toml").read_text()


@pytest.mark.usefixtures("calculated")
def test_more_trials_are_those_of_a_longer_tuning(tmp_path, scenario):
    tuned(scenario, tmp_path / "whole", seeds=1, trials=14)
    tuned(scenario, tmp_path / "t", seeds=1, trials=5)
    assert gone_on_with(tmp_path / "t", trials=14).is_over
    assert trials_in(tmp_path / "t").equals(trials_in(tmp_path / "whole"), null_equal=True)
    assert json.loads((tmp_path / "t" / "tuning.json").read_text())["trials"] == 14
    with refused_input("--trials", match="14"):
        gone_on_with(tmp_path / "t", trials=13)


@pytest.mark.usefixtures("calculated")
def test_half_written_line_of_a_killed_process_is_no_trial(tmp_path, scenario):
    tuned(scenario, tmp_path / "whole", seeds=1, trials=5)
    tuned(scenario, tmp_path / "t", seeds=1, trials=5, until=1)
    journal = tmp_path / "t" / FILE
    journal.write_bytes(journal.read_bytes() + b'{"op_code": 6, "trial')
    assert gone_on_with(tmp_path / "t").is_over
    assert trials_in(tmp_path / "t").equals(trials_in(tmp_path / "whole"), null_equal=True)


@pytest.mark.usefixtures("calculated")
def test_time_that_most_runs_do_not_reach_is_worse_than_any_reached(tmp_path, scenario):
    result = tuned(scenario, tmp_path / "t", "metrics.1.after_s=0.1:0.9", goal="min ready_s", trials=10)
    rows = trials_in(tmp_path / "t")
    late = rows.filter(pl.col("metrics.1.after_s") > 0.4)
    assert set(late["value"]) == {1.0}
    assert late["statistic"].null_count() == len(late)
    assert set(late["censored"]) == {1.0}
    early = rows.filter(pl.col("metrics.1.after_s") <= 0.4)
    assert all(value <= 0.5 for value in early["value"])
    assert result.best.result.value == early["value"].min()


@pytest.mark.usefixtures("calculated")
def test_changed_files_and_other_code_are_refused(tmp_path, scenario):
    tuned(scenario, tmp_path / "t", trials=2)
    about = tmp_path / "t" / "tuning.json"
    content = json.loads(about.read_text())
    about.write_text(json.dumps({**content, "versions": {**content["versions"], "numpy": "1.0"}}))
    with refused_input(match=r"numpy.* 1\.0.*--force"):
        gone_on_with(tmp_path / "t")
    about.write_text(json.dumps(content))
    (tmp_path / "t" / "scenario" / "files" / "careful.py").write_text("x = 1")
    with refused_input(match="scenario/files/careful.py"):
        gone_on_with(tmp_path / "t")


@pytest.mark.usefixtures("calculated")
@pytest.mark.parametrize("text", [None, "{", "[]", '{"format": 1}', '{"format": 2}'])
def test_folder_without_a_tuning_is_refused_in_a_line(tmp_path, text):
    if text is not None:
        (tmp_path / "tuning.json").write_text(text)
    with refused_input(match=f"^{tmp_path}"):
        gone_on_with(tmp_path)


@pytest.mark.usefixtures("executors")
def test_best_trial_is_a_scenario_that_runs_from_the_folder_alone(tmp_path, scenario):
    options = {"trials": 6, "seeds": 1, "overrides": ("duration_s=0.3",)}
    result = tuned(scenario, tmp_path / "t", AT, "robots.pair.count=2:4", **options)
    shutil.rmtree(tmp_path / "t" / "scenario")
    for file in ("bowl.py", "careful.py", "bowl.toml"):
        (tmp_path / file).unlink()
    repetition = run(tmp_path / "t" / "best.toml")
    assert (repetition.ticks, repetition.arenas[0].seed) == (3, 7)
    assert repetition.metrics["bowl"].final == result.best.result.value
    assert repetition.robots == result.best.parameters["robots.pair.count"]


@pytest.mark.usefixtures("executors")
def test_trials_that_fail_are_told_of_and_never_the_best(tmp_path, scenario):
    searched = ("robots.pair.params.speed=0:1", AT)
    result = tuned(scenario, tmp_path / "t", *searched, trials=8, seeds=1)
    rows = trials_in(tmp_path / "t")
    too_fast = pl.col("robots.pair.params.speed") > 0.5
    failed, complete = rows.filter(too_fast), rows.filter(~too_fast)
    assert set(failed["state"]) == {"failed"}
    assert set(failed["failed"]) == {1}
    assert failed["value"].null_count() == len(failed)
    assert all("ValueError: too fast" in error for error in failed["error"])
    assert set(complete["state"]) == {"complete"}
    assert result.best.parameters["robots.pair.params.speed"] <= 0.5


@pytest.mark.usefixtures("executors")
def test_values_that_are_invalid_together_fail_their_trial(tmp_path, scenario):
    searched = ("robots.pair.count=2,60", "arena.size_m=[4.0, 4.0],[0.3, 0.3]")
    result = tuned(scenario, tmp_path / "t", *searched, trials=6, seeds=1)
    rows = trials_in(tmp_path / "t")
    crowded = (pl.col("robots.pair.count") == "60") & (pl.col("arena.size_m") == "[0.3, 0.3]")
    assert set(rows.filter(crowded)["state"]) == {"failed"}
    assert set(rows.filter(~crowded)["state"]) == {"complete"}
    assert result.is_over


@pytest.mark.usefixtures("executors")
def test_choices_may_be_files_which_the_folder_keeps(tmp_path, scenario):
    (tmp_path / "other.py").write_text((tmp_path / "careful.py").read_text())
    searched = "robots.pair.agent=careful.py:Careful,other.py:Careful"
    tuned(scenario, tmp_path / "t", searched, trials=2, seeds=1, until=1, parallel_trials=1)
    for file in ("careful.py", "other.py", "bowl.py"):
        (tmp_path / file).unlink()
    result = gone_on_with(tmp_path / "t", trials=5)
    assert set(trials_in(tmp_path / "t")["robots.pair.agent"]) == {"careful.py:Careful", "other.py:Careful"}
    assert run(tmp_path / "t" / "best.toml").ended == "duration"
    assert result.is_over


@pytest.fixture
def typed(monkeypatch, capsys, calculated):
    return lambda *arguments: called(monkeypatch, capsys, *arguments)


def test_tune_command_prints_what_it_found_its_worth_and_what_to_do_next(tmp_path, scenario, typed):
    folder = tmp_path / "t"
    searched = ("--search", AT, "--search", "robots.pair.params.steps=1:8")
    counts = ("--trials", "20", "--seeds", "2", "--check-seeds", "3")
    code, out, errors = typed("tune", scenario, *searched, *GOAL, *counts, "--out", folder)
    assert (code, errors) == (0, "")
    lines = [" ".join(line.split()) for line in out.splitlines()]
    best = trials_in(folder)["value"].arg_min()
    assert lines[0].endswith("min bowl.final.q50: 20 trials x 2 seeds")
    assert any(re.match(rf"20/20 trials, .* \(trial {best}\)", line) for line in lines)
    assert any(re.fullmatch(r"│ metrics.0.at │ 0.[67]\d* │ 0 to 1 │ \d+ % │", line) for line in lines)
    assert "0.36 (0.36 to 0.36)" in out
    compare = f"swarmwire compare {folder}/check/baseline {folder}/check/trial-{best}"
    commands = f"swarmwire run {folder}/best.toml", compare, f"swarmwire tune --resume {folder} --trials 40"
    for line, command in zip(lines[-4:], (str(folder), *commands), strict=True):
        assert line.endswith(f": {command}")
    assert json.loads((folder / "tuning.json").read_text())["command"].startswith(f"swarmwire tune {scenario}")
    assert typed(*compare.split()[1:], "--response", "bowl")[0] == 0
    assert typed("tune", "--resume", folder)[0] == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "SCENARIO: is missing"),
        (["bowl.toml", "--search", AT], "--goal: is missing"),
        (["bowl.toml", *GOAL, "--search", "robots.pair.cuont=1:2"], "--search robots.pair.cuont=1:2: .*cuont: "),
        (["bowl.toml", *GOAL, "--search", "metrics.0.at=0:2"], "--search metrics.0.at=0:2: .*at most 1"),
        (["bowl.toml", *GOAL, "--search", "robots.pair.body=epuck,epock"], "--search robots.pair.body=.*epuck"),
        (["bowl.toml", *GOAL, "--search", "seed=1:5"], "--search seed=1:5: "),
        (["bowl.toml", *GOAL, "--search", AT, "--search", AT], f"--search {AT}: .*once"),
        (["bowl.toml", "--goal", "min bawl", "--search", AT], "--goal: bawl: .*bowl"),
        (["bowl.toml", *GOAL, "--search", AT, "--trials", "0"], "--trials: expected 1 to"),
        (["bowl.toml", *GOAL, "--search", AT, "--check-seeds", "20:30"], "--check-seeds: .*20"),
        (["bowl.toml", *GOAL, "--search", AT, "--set", "duration_s=-1"], "--set duration_s=-1"),
        (["--resume", "nowhere"], "nowhere: "),
        (["bowl.toml", "--resume", "nowhere"], "SCENARIO: .*--resume"),
    ],
)
def test_tune_options_that_are_invalid_are_refused_in_a_line(
    tmp_path, scenario, monkeypatch, capsys, arguments, message
):
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.iterdir())
    refused_command(monkeypatch, capsys, "tune", *arguments, match=message)
    assert sorted(tmp_path.iterdir()) == before


class Interrupting(NoObserver):
    """Presses Ctrl-C after the third trial."""

    def begin(self, *_, **__):
        pass

    def see(self, result):
        if result.number == 2:
            os.kill(os.getpid(), signal.SIGINT)


def test_ctrl_c_ends_it_with_a_word_how_to_go_on(tmp_path, scenario, typed, monkeypatch):
    folder = tmp_path / "t"
    with monkeypatch.context() as patched:
        patched.setattr(tune, "TuneProgress", lambda _: Interrupting())
        options = ("--search", AT, *GOAL, "--trials", "6", "--seeds", "1")
        code, out, errors = typed("tune", scenario, *options, "--out", folder)
    assert (code, errors) == (130, "")
    first, best, last = out.splitlines()
    assert "3 of 6 trials" in first
    assert re.search(r"metrics.0.at=\S+$", best)
    assert last.endswith(f"swarmwire tune --resume {folder}")
    code, out, _ = typed("tune", "--resume", folder)
    assert code == 0
    assert re.search("6 trials x 1 seeds; 3 of them", out.splitlines()[0])


def test_tune_command_in_which_all_trials_fail_is_a_line_and_exit_code_1(
    tmp_path, scenario, monkeypatch, capsys, executors
):
    folder, searched = tmp_path / "t", "robots.pair.params.speed=0.6:1"
    arguments = ("--search", searched, *GOAL, "--trials", "2", "--seeds", "1", "--out", folder, "--quiet")
    code, out, errors = called(monkeypatch, capsys, "tune", scenario, *arguments)
    assert (code, out) == (1, "")
    assert re.fullmatch(r"error: \S+: all 2 trials failed.* trial 0: ValueError: too fast.*\n", errors)
    assert not (folder / "best.toml").exists()


def test_tuning_that_is_killed_leaves_no_worker_and_can_be_resumed(tmp_path, typed):
    scenario, folder = scenario_in(tmp_path), tmp_path / "t"
    command = [sys.executable, "-c", KILLED, str(scenario), str(folder)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT) as process:
        assert process.stdout is not None
        lines = iter(process.stdout)
        assert [next(lines).strip() for _ in range(4)] == ["begins", "trial", "trial", "trial"]
        workers = psutil.Process(process.pid).children(recursive=True)
        assert len(workers) == 1
        process.kill()
        ended, alive = psutil.wait_procs(workers, timeout=60)
    assert (len(ended), alive) == (1, [])
    code, out, _ = typed("tune", "--resume", folder)
    match = re.search(r"5 trials x 1 seeds; (\d) of them are there", out)
    assert code == 0
    assert int(match[1]) >= 3
    tuned(scenario, tmp_path / "whole", seeds=1, trials=5, parallel_trials=2)
    assert trials_in(folder).equals(trials_in(tmp_path / "whole"), null_equal=True)
