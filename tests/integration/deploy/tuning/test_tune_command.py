"""`swarmwire tune`, as people type it."""

import json
import os
import re
import signal

import pytest

from swarmwire.deploy.terminal import tune_progress
from tests.support.deploy.commands import called
from tests.support.deploy.tuning.small import AT, trials_in

GOAL = ("--goal", "min bowl")


@pytest.fixture
def typed(monkeypatch, capsys, calculated):
    return lambda *arguments: called(monkeypatch, capsys, *arguments)


def test_a_tuning_says_what_it_found_what_that_is_worth_and_what_to_do_next(tmp_path, scenario, typed):
    folder = tmp_path / "t"
    searched = ("--search", AT, "--search", "robots.pair.params.steps=1:8")
    code, out, errors = typed(
        "tune", scenario, *searched, *GOAL, "--trials", "20", "--seeds", "2", "--check-seeds", "3", "--out", folder
    )  # fmt: skip
    assert (code, errors) == (0, "")
    lines = [" ".join(line.split()) for line in out.splitlines()]
    best = trials_in(folder)["value"].arg_min()
    assert lines[0] == "bowl: min bowl.final.q50: 20 trials x 2 seeds"
    assert any(re.fullmatch(rf"20/20 trials, best: .* \(trial {best}\), 0 s left", line) for line in lines)
    assert f"bowl: the best of 20 trials is trial {best}" in lines
    assert any(re.fullmatch(r"│ metrics.0.at │ 0.[67]\d* │ 0 to 1 │ \d+ % │", line) for line in lines)
    assert any(re.fullmatch(r"│ the scenario's own │ │ 0.36 \(0.36 to 0.36\) │", line) for line in lines)
    assert lines[-4:] == [
        f"written: {folder}",
        f"run the best: swarmwire run {folder}/best.toml",
        f"compare all outcomes: swarmwire compare {folder}/check/own {folder}/check/trial-{best}",
        f"try more: swarmwire tune --resume {folder} --trials 40",
    ]
    assert json.loads((folder / "tuning.json").read_text())["command"].startswith(f"swarmwire tune {scenario}")
    code, out, _ = typed("compare", folder / "check" / "own", folder / "check" / f"trial-{best}", "--outcome", "bowl")
    assert code == 0
    assert typed("tune", "--resume", folder)[0] == 0


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ([], "SCENARIO: is missing"),
        (["bowl.toml", "--search", AT], "--goal: is missing"),
        (["bowl.toml", *GOAL], "--search: is missing"),
        (["no.toml", *GOAL, "--search", AT], "no.toml: expected a readable file"),
        (["bowl.toml", *GOAL, "--search", "robots.pair.cuont=1:2"], "--search robots.pair.cuont=1:2: .*unknown key"),
        (["bowl.toml", *GOAL, "--search", "metrics.0.at=0:2"], "--search metrics.0.at=0:2: .*at most 1"),
        (["bowl.toml", *GOAL, "--search", "metrics.0.at=-1:1"], "--search metrics.0.at=-1:1: .*at least 0"),
        (["bowl.toml", *GOAL, "--search", "robots.pair.body=epuck,epock"], "--search robots.pair.body=.*epuck"),
        (["bowl.toml", *GOAL, "--search", "seed=1:5"], "--search seed=1:5: .*seed cannot vary"),
        (["bowl.toml", *GOAL, "--search", AT, "--search", AT], f"--search {AT}: expected each path once"),
        (["bowl.toml", "--goal", "min bawl", "--search", AT], "--goal: bawl: expected one of .*bowl"),
        (["bowl.toml", *GOAL, "--search", AT, "--trials", "0"], "--trials: expected 1 to"),
        (["bowl.toml", *GOAL, "--search", AT, "--batch", "0"], "--batch: expected 1 to"),
        (["bowl.toml", *GOAL, "--search", AT, "--sampler", "tpee"], "--sampler: .*did you mean tpe"),
        (["bowl.toml", *GOAL, "--search", AT, "--sampler-seed", "-1"], "--sampler-seed: expected"),
        (["bowl.toml", *GOAL, "--search", AT, "--check-seeds", "20:30"], "--check-seeds: .*20 is among both"),
        (["bowl.toml", *GOAL, "--search", AT, "--set", "duration_s=-1"], "--set duration_s=-1"),
        (["--resume", "nowhere"], "nowhere: expected a tuning's folder"),
        (["bowl.toml", "--resume", "nowhere"], "SCENARIO: expected --resume without it"),
    ],
)
def test_what_cannot_be_tuned_is_refused_in_a_line_before_anything_is(
    tmp_path, scenario, typed, monkeypatch, arguments, told
):
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.iterdir())
    code, out, errors = typed("tune", *arguments)
    assert (code, out) == (2, "")
    assert re.match(f"error: {told}", errors), errors
    assert errors.count("\n") == 1
    assert sorted(tmp_path.iterdir()) == before


class Interrupting:
    """Looks on, and presses Ctrl-C after the first trial."""

    def begin(self, tuning, trials):
        pass

    def see(self, trial):
        os.kill(os.getpid(), signal.SIGINT) if trial.number == 2 else None

    def end(self):
        pass


def test_ctrl_c_ends_it_with_a_word_how_to_go_on(tmp_path, scenario, typed, monkeypatch):
    folder = tmp_path / "t"
    with monkeypatch.context() as patched:
        patched.setattr(tune_progress, "tune_progress", lambda _: Interrupting())
        code, out, errors = typed(
            "tune", scenario, "--search", AT, *GOAL, "--trials", "6", "--seeds", "1", "--out", folder
        )
    assert (code, errors) == (130, "")
    first, best, last = out.splitlines()
    assert first == "interrupted: 3 of 6 trials are done"
    assert re.fullmatch(r"best so far: \S+ with metrics.0.at=\S+", best)
    assert last == f"go on: swarmwire tune --resume {folder}"
    code, out, _ = typed("tune", "--resume", folder)
    assert (code, out.splitlines()[0]) == (0, "bowl: min bowl.final.q50: 6 trials x 1 seeds; 3 of them are there")


def test_where_all_trials_fail_it_is_a_line_and_exit_code_1(tmp_path, scenario, monkeypatch, capsys, here):
    folder, searched = tmp_path / "t", "robots.pair.params.speed=0.6:1"
    arguments = ("--search", searched, *GOAL, "--trials", "2", "--seeds", "1", "--out", folder, "--quiet")
    code, out, errors = called(monkeypatch, capsys, "tune", scenario, *arguments)
    assert (code, out) == (1, "")
    assert re.fullmatch(r"error: \S+: all 2 trials failed, such as trial 0: ValueError: too fast, in tick .*\n", errors)
