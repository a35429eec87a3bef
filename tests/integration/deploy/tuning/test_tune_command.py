"""`swarmwire tune`, as people type it."""

import json
import os
import re
import signal

import pytest

from swarmwire.deploy.terminal import tune
from tests.support.deploy.runs import called
from tests.support.deploy.tuning import AT, trials_in

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
    assert lines[0].endswith("min bowl.final.q50: 20 trials x 2 seeds")
    assert any(re.match(rf"20/20 trials, .* \(trial {best}\)", line) for line in lines)
    assert any(re.fullmatch(r"│ metrics.0.at │ 0.[67]\d* │ 0 to 1 │ \d+ % │", line) for line in lines)
    assert "0.36 (0.36 to 0.36)" in out
    for line, command in zip(
        lines[-4:],
        (
            str(folder),
            f"swarmwire run {folder}/best.toml",
            f"swarmwire compare {folder}/check/baseline {folder}/check/trial-{best}",
            f"swarmwire tune --resume {folder} --trials 40",
        ),
        strict=True,
    ):
        assert line.endswith(f": {command}")
    assert json.loads((folder / "tuning.json").read_text())["command"].startswith(f"swarmwire tune {scenario}")
    code, out, _ = typed(
        "compare", folder / "check" / "baseline", folder / "check" / f"trial-{best}", "--response", "bowl"
    )
    assert code == 0
    assert typed("tune", "--resume", folder)[0] == 0


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ([], "SCENARIO: is missing"),
        (["bowl.toml", "--search", AT], "--goal: is missing"),
        (["bowl.toml", *GOAL], "--search: is missing"),
        (["no.toml", *GOAL, "--search", AT], "no.toml: "),
        (["bowl.toml", *GOAL, "--search", "robots.pair.cuont=1:2"], "--search robots.pair.cuont=1:2: .*cuont: "),
        (["bowl.toml", *GOAL, "--search", "metrics.0.at=0:2"], "--search metrics.0.at=0:2: .*at most 1"),
        (["bowl.toml", *GOAL, "--search", "metrics.0.at=-1:1"], "--search metrics.0.at=-1:1: .*at least 0"),
        (["bowl.toml", *GOAL, "--search", "robots.pair.body=epuck,epock"], "--search robots.pair.body=.*epuck"),
        (["bowl.toml", *GOAL, "--search", "seed=1:5"], "--search seed=1:5: "),
        (["bowl.toml", *GOAL, "--search", AT, "--search", AT], f"--search {AT}: .*once"),
        (["bowl.toml", "--goal", "min bawl", "--search", AT], "--goal: bawl: .*bowl"),
        (["bowl.toml", *GOAL, "--search", AT, "--trials", "0"], "--trials: expected 1 to"),
        (["bowl.toml", *GOAL, "--search", AT, "--parallel-trials", "0"], "--parallel-trials: expected 1 to"),
        (["bowl.toml", *GOAL, "--search", AT, "--sampler", "tpee"], "--sampler: .*tpe"),
        (["bowl.toml", *GOAL, "--search", AT, "--sampler-seed", "-1"], "--sampler-seed: "),
        (["bowl.toml", *GOAL, "--search", AT, "--check-seeds", "20:30"], "--check-seeds: .*20"),
        (["bowl.toml", *GOAL, "--search", AT, "--set", "duration_s=-1"], "--set duration_s=-1"),
        (["--resume", "nowhere"], "nowhere: "),
        (["bowl.toml", "--resume", "nowhere"], "SCENARIO: .*--resume"),
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
        patched.setattr(tune, "TuneProgress", lambda _: Interrupting())
        code, out, errors = typed(
            "tune", scenario, "--search", AT, *GOAL, "--trials", "6", "--seeds", "1", "--out", folder
        )
    assert (code, errors) == (130, "")
    first, best, last = out.splitlines()
    assert "3 of 6 trials" in first
    assert re.search(r"metrics.0.at=\S+$", best)
    assert last.endswith(f"swarmwire tune --resume {folder}")
    code, out, _ = typed("tune", "--resume", folder)
    assert code == 0
    assert re.search("6 trials x 1 seeds; 3 of them", out.splitlines()[0])


def test_where_all_trials_fail_it_is_a_line_and_exit_code_1(tmp_path, scenario, monkeypatch, capsys, here):
    folder, searched = tmp_path / "t", "robots.pair.params.speed=0.6:1"
    arguments = ("--search", searched, *GOAL, "--trials", "2", "--seeds", "1", "--out", folder, "--quiet")
    code, out, errors = called(monkeypatch, capsys, "tune", scenario, *arguments)
    assert (code, out) == (1, "")
    assert re.fullmatch(r"error: \S+: all 2 trials failed.* trial 0: ValueError: too fast.*\n", errors)
