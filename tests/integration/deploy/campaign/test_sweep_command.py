"""`swarmwire sweep` and `swarmwire repeat --run`, as people type them."""

import json
import os
import re
import signal

import pytest

from swarmwire.deploy import RunFolder
from swarmwire.deploy.campaign.spec import campaign_file, spec_in
from swarmwire.deploy.terminal import sweep
from tests.support.deploy.campaign import rows_in
from tests.support.deploy.runs import called

CAMPAIGN = """
format = 1
scenario = "two.toml"
name = "losses"
seeds = 2
overrides = ["duration_s=0.3"]
[vary]
"radio.loss" = { from = 0.0, to = 0.5, count = 2 }
robots.pair.count = [3]
"""


@pytest.fixture
def typed(monkeypatch, capsys, here):
    return lambda *arguments: called(monkeypatch, capsys, *arguments)


def test_a_sweep_says_what_it_did_and_what_to_do_next(tmp_path, scenario, typed):
    folder = tmp_path / "c"
    code, out, errors = typed(
        "sweep", scenario, "--vary", "radio.loss=0:0.5:2", "--seeds", "3", "--set", "duration_s=0.3", "--out", folder
    )  # fmt: skip
    assert (code, errors) == (0, "")
    for said in ("two robots: 2 points x 3 seeds = 6 runs", "6/6 runs", f"swarmwire report {folder}"):
        assert said in out
    assert out.endswith(f"swarmwire repeat {folder} --run 5\n")
    found = json.loads((folder / "campaign.json").read_text())
    assert found["command"].startswith(f"swarmwire sweep {scenario} --vary radio.loss=0:0.5:2 --seeds 3")
    assert found["overrides"] == ["duration_s=0.3"]
    assert {row["ticks"] for row in rows_in(folder)} == {3}


def test_seeds_mean_the_same_to_run_to_sweep_and_in_a_campaigns_file(tmp_path, scenario, typed):
    asked = (scenario, "--seeds", "2", "--set", "duration_s=0.1", "--quiet", "--out")
    assert typed("run", *asked, tmp_path / "run", "--no-rrd")[0] == typed("sweep", *asked, tmp_path / "sweep")[0] == 0
    (tmp_path / "file.toml").write_text(f'format = 1\nscenario = "{scenario.name}"\nseeds = 2\nrecord_seeds = "2"\n')
    of_file = spec_in(tmp_path / "file.toml", campaign_file(tmp_path / "file.toml"))
    assert of_file.seeds == of_file.record_seeds == (1, 2)
    for written in ("run/run.json", "sweep/campaign.json"):
        assert json.loads((tmp_path / written).read_text())["seeds"] == [1, 2]


def test_a_campaigns_file_says_the_same_as_options_which_go_first(tmp_path, scenario, typed):
    (tmp_path / "losses.toml").write_text(CAMPAIGN)
    assert typed("sweep", tmp_path / "losses.toml", "--out", tmp_path / "a")[0] == 0
    options = ("--vary", "radio.loss=0:0.5:2", "--vary", "robots.pair.count=3", "--seeds", "2")
    assert typed("sweep", scenario, *options, "--set", "duration_s=0.3", "--out", tmp_path / "b")[0] == 0
    assert rows_in(tmp_path / "a") == rows_in(tmp_path / "b")
    assert json.loads((tmp_path / "a" / "campaign.json").read_text())["name"] == "losses"
    assert (
        typed("sweep", tmp_path / "losses.toml", "--seeds", "1", "--vary", "radio.loss=0.1", "--out", tmp_path / "c")[0]
        == 0
    )
    assert [row["radio.loss"] for row in rows_in(tmp_path / "c")] == [0.1]


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("secnario = 'two.toml'", "secnario: "),
        ("scenario = 3", "scenario: "),
        ("format = 2", "format: "),
        ("seeds = 0", "seeds: "),
        ("design = 'gird'", "--design: "),
        ("vary = { 'radio.loss' = 3 }", r"vary\.radio\.loss: "),
        ("vary = { 'radio.loss' = [] }", r"vary\.radio\.loss: "),
        ("vary = { 'radio.lss' = [1] }", r"vary\.radio\.lss: radio\.lss: "),
        ("overrides = [3]", r"overrides\[0\]: "),
    ],
)
def test_a_campaigns_file_is_refused_by_its_key(tmp_path, scenario, typed, line, told):
    keys = {"format": "1", "scenario": "'two.toml'", "seeds": "2"} | dict([line.split(" = ", 1)])
    file = tmp_path / "campaign.toml"
    file.write_text("\n".join(f"{key} = {value}" for key, value in keys.items()))
    code, _, errors = typed("sweep", file, "--out", tmp_path / "c")
    assert code == 2
    assert re.match(f"error: (.*campaign.toml: )?{told}", errors), errors
    assert errors.count("\n") == 1
    assert not (tmp_path / "c").exists()


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ([], "SCENARIO: is missing"),
        (["two.toml"], "--seeds: is missing"),
        (["two.toml", "--seeds", "0"], "--seeds: expected "),
        (["two.toml", "--seeds", "2", "--vary", "radio.losss=0,1"], "--vary radio.losss=0,1: radio.losss: "),
        (["two.toml", "--seeds", "2", "--design", "list"], "--design: .*empty"),
        (["no.toml", "--seeds", "2"], "no.toml: "),
        (["--resume", "nowhere"], "nowhere: "),
        (["--resume", "nowhere", "--seeds", "3"], "SCENARIO: "),
        (["two.toml", "--seeds", "2", "--record-seeds", "9"], "--record-seeds: "),
    ],
)
def test_what_cannot_be_run_is_refused_in_a_line_before_anything_is(
    tmp_path, scenario, typed, monkeypatch, arguments, told
):
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.iterdir())
    code, out, errors = typed("sweep", *arguments)
    assert (code, out) == (2, "")
    assert re.match(f"error: {told}", errors), errors
    assert errors.count("\n") == 1
    assert sorted(tmp_path.iterdir()) == before


def test_resume_takes_the_same_campaign_alone(tmp_path, scenario, typed):
    folder, vary = tmp_path / "c", ("--vary", "radio.loss=0,0.5")
    assert typed("sweep", scenario, *vary, "--seeds", "2", "--out", folder)[0] == 0
    assert typed("sweep", scenario, *vary, "--seeds", "2", "--resume", folder)[0] == 0
    for arguments, key in (
        (("--seeds", "3", *vary), "seeds"),
        (("--seeds", "2", "--vary", "radio.loss=0,0.6"), "vary"),
        (("--seeds", "2", *vary, "--set", "duration_s=0.2"), "files"),
    ):
        code, _, errors = typed("sweep", scenario, *arguments, "--resume", folder)
        assert code == 2
        assert errors.startswith(f"error: --resume {folder}: {key}: ")


def test_a_run_is_repeated_by_its_number(tmp_path, scenario, typed):
    folder = tmp_path / "c"
    typed("sweep", scenario, "--vary", "radio.loss=0,0.5", "--seeds", "4:6", "--out", folder)
    code, out, errors = typed("repeat", folder, "--run", "3", "--out", tmp_path / "again")
    row, again = rows_in(folder)[3], RunFolder(tmp_path / "again")
    assert (code, errors) == (0, "")
    assert f"seed 5: trajectory {row['trajectory_sha256'][:16]}…" in out
    assert again.summary is not None
    assert again.summary["trajectory_sha256"] == [row["trajectory_sha256"]]
    (folder / "summary.parquet").unlink()
    code, out, _ = typed("repeat", folder, "--run", "3")
    assert (code, "nothing to compare with" in out) == (1, True)
    assert typed("repeat", folder, "--run", "4")[2].startswith("error: --run: ")
    assert "--run" in typed("repeat", folder)[2]
    assert typed("repeat", tmp_path / "again", "--run", "0")[0] == 2


class Interrupting:
    """Looks on, and presses Ctrl-C after the first task."""

    def begin(self, campaign, done, failed):
        self.tasks = done

    def see(self, result):
        self.tasks += 1
        if self.tasks == 1:
            os.kill(os.getpid(), signal.SIGINT)

    def end(self):
        pass


def test_ctrl_c_ends_it_with_a_word_how_to_go_on(tmp_path, scenario, typed, monkeypatch):
    folder = tmp_path / "c"
    monkeypatch.setattr(sweep, "SweepProgress", lambda _: Interrupting())
    code, out, errors = typed("sweep", scenario, "--seeds", "5", "--batch", "1", "--out", folder)
    assert (code, errors) == (130, "")
    assert "3 of 5 runs" in out
    assert out.endswith(f"swarmwire sweep --resume {folder}\n")
    assert typed("sweep", "--resume", folder)[0] == 0
    assert len(rows_in(folder)) == 5
