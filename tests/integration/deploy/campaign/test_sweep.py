"""Campaigns: from Python and by the command line."""

import json
import os
import signal

import numpy as np
import polars as pl
import pytest

from swarmwire.deploy import RunFolder, run, sweep
from swarmwire.deploy.campaigns import sweep as sweeping
from swarmwire.deploy.campaigns.spec import campaign_file, spec_in
from swarmwire.deploy.campaigns.sweep import NoObserver
from swarmwire.metrics.records.campaign.campaign_json import read_campaign
from tests.support.deploy.campaign import InThisProcess, rows_in, scenario_in, series_in
from tests.support.deploy.runs import called, refused_command

VARY = {"radio.loss": "0:0.8:2", "robots.pair.count": [2, 3]}
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


def agent_in(folder, name, step):
    """An agent of a step in a file of this folder, as scenarios name it."""
    code = f"from swarmwire.agent import Agent\nclass Mine(Agent):\n    def step(self, it): {step}\n"
    (folder / f"{name}.py").write_text(code)
    return f"{name}.py:Mine"


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    """A campaign of four points."""
    folder = tmp_path_factory.mktemp("reference")
    scenario = scenario_in(folder)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(sweeping, "open_executor", lambda *_: InThisProcess())
        done = sweep(scenario, seeds=3, vary=VARY, out=folder / "c")
    assert (done.runs, done.done, done.failed, done.is_over) == (12, 12, 0, True)
    return folder


def test_row_of_a_sweep_has_what_a_run_of_its_own_has(reference):
    rows = rows_in(reference / "c")
    assert [(row["run"], row["point"], row["seed"]) for row in rows] == [(i, i // 3, i % 3 + 1) for i in range(12)]
    points = [(row["radio.loss"], row["robots.pair.count"]) for row in rows[::3]]
    assert points == [(0.0, 2), (0.0, 3), (0.8, 2), (0.8, 3)]
    alone = run(reference / "two.toml", seed=2, overrides=["radio.loss=0.8", "robots.pair.count=3"])
    row, radio = rows[10], alone.radio
    assert row["trajectory_sha256"] == alone.trajectory_sha256[0]
    assert (row["ended"], row["error"], row["ticks"], row["sim_time_s"]) == ("duration", None, 5, 0.5)
    assert row["order.mean"] == alone.metrics["order"].mean
    assert (row["radio.sent"], row["radio.pdr"], row["radio.link_pdr"]) == (radio.sent, radio.pdr, radio.link_pdr)
    assert row["radio.fates.lost"] == radio.fates["lost"]
    assert row["radio.latency_air_s.p90"] == radio.latency_air_s.p90
    assert row["target_best.final"] is None


def test_columns_have_one_order(reference):
    columns = pl.read_parquet(reference / "c" / "summary.parquet").columns
    assert columns[:7] == ["run", "point", "seed", "radio.loss", "robots.pair.count", "ended", "error"]
    assert columns[-4:] == ["timing_wall_s", "machine_cpu", "machine_host", "machine_worker"]
    assert columns.index("order.final") < columns.index("radio.sent") < columns.index("counts.clipped_commands")


def test_series_hold_each_ticks_metrics(reference):
    series = series_in(reference / "c")
    assert series.select("run", "tick").to_numpy().tolist() == [[run, tick] for run in range(12) for tick in range(5)]
    assert series.schema["order"] == pl.Float32
    rows = rows_in(reference / "c")
    last = series.filter(pl.col("tick") == 4)["order"].to_numpy()
    np.testing.assert_array_equal(last, np.float32([row["order.final"] for row in rows]))


def test_campaign_folder_says_what_was_run_and_holds_nothing_else(reference):
    about = json.loads((reference / "c" / "campaign.json").read_text())
    names = {path.name for path in (reference / "c").iterdir()}
    assert names == {"campaign.json", "scenario", "series", "summary.parquet"}
    assert about["vary"] == {"radio.loss": [0.0, 0.8], "robots.pair.count": [2, 3]}
    assert about["points"][2] == {"radio.loss": 0.8, "robots.pair.count": 2}
    assert about["seeds"] == [1, 2, 3]
    assert (about["design"], about["scenario"], about["name"]) == ("grid", "two robots", "two robots")
    assert (reference / "c" / "scenario" / "scenario.toml").exists()


def test_without_series_there_are_none(scenario, tmp_path, executors):
    sweep(scenario, seeds=2, out=tmp_path / "c", series=False)
    assert not (tmp_path / "c" / "series").exists()
    assert len(rows_in(tmp_path / "c")) == 2


def test_files_that_points_name_are_kept_with_the_campaign(tmp_path, scenario, executors):
    agents = [agent_in(tmp_path, name, f"it.drive({speed}, 0.0)") for name, speed in (("slow", 0.01), ("fast", 0.1))]
    sweep(scenario, seeds=1, vary={"robots.pair.agent": agents}, out=tmp_path / "c")
    campaign = read_campaign(tmp_path / "c")
    assert [point["robots.pair.agent"] for point in campaign.points] == agents
    assert {file.path for file in campaign.files} == {"scenario.toml", "files/slow.py", "files/fast.py"}
    for agent, row in zip(agents, rows_in(tmp_path / "c"), strict=True):
        assert run(scenario, overrides=[f"robots.pair.agent={agent}"]).trajectory_sha256 == [row["trajectory_sha256"]]


def test_chosen_seeds_are_recorded_in_full(tmp_path, scenario, executors):
    sweep(scenario, seeds=2, vary={"radio.loss": [0.0, 0.5]}, out=tmp_path / "c", record_seeds=[2])
    assert sorted(path.name for path in (tmp_path / "c" / "runs").iterdir()) == ["run-000001", "run-000003"]
    recorded = RunFolder(tmp_path / "c" / "runs" / "run-000003")
    assert (recorded.path / "run.rrd").exists()
    assert recorded.summary["trajectory_sha256"] == [rows_in(tmp_path / "c")[3]["trajectory_sha256"]]


def test_recorded_runs_are_local_and_last_where_workers_cannot_write_here(tmp_path, scenario, monkeypatch):
    done_by, remote, local = list[tuple[str, int]](), InThisProcess(), InThisProcess()
    remote.records = False
    for name, executor in (("there", remote), ("local", local)):
        monkeypatch.setattr(executor, "submit", noting(executor.submit, name, done_by))
    monkeypatch.setattr(sweeping, "open_executor", lambda name, *_: local if name == "local" else remote)
    sweep(scenario, seeds=3, out=tmp_path / "c", record_seeds=[2], batch=1, executor="there://")
    assert done_by == [("there", 1), ("there", 3), ("local", 2)]
    assert (remote.closed, local.closed) == (True, True)
    assert [path.name for path in (tmp_path / "c" / "runs").iterdir()] == ["run-000001"]
    assert [row["ended"] for row in rows_in(tmp_path / "c")] == ["duration"] * 3


def noting(submit, name, done_by):
    """`submit` that notes each task's seed."""

    def submit_noted(task):
        done_by.extend((name, seed) for seed in task.seeds)
        submit(task)

    return submit_noted


def test_drawn_designs_say_between_which_values(tmp_path, scenario, executors):
    sweep(scenario, seeds=1, vary={"radio.loss": "0:0.5"}, design="latin", points=4, out=tmp_path / "c")
    campaign = read_campaign(tmp_path / "c")
    assert campaign.vary == {"radio.loss": {"from": 0.0, "to": 0.5}}
    assert [row["radio.loss"] for row in rows_in(tmp_path / "c")] == [point["radio.loss"] for point in campaign.points]


def test_arenas_that_stop_and_times_of_metrics_are_the_same_packed_and_alone(tmp_path, scenario, executors):
    ends = ['stop={metric="order", at_least=0.8, hold_s=0.1}', 'metrics=["aggregation_time_s"]', "duration_s=1.0"]
    for name, batch in (("packed", 6), ("alone", 1)):
        sweep(scenario, seeds=6, out=tmp_path / name, overrides=ends, batch=batch)
    rows = rows_in(tmp_path / "packed")
    assert rows == rows_in(tmp_path / "alone")
    assert series_in(tmp_path / "packed").equals(series_in(tmp_path / "alone"), null_equal=True)
    assert {row["ended"] for row in rows} == {"stopped", "duration"}
    for row in rows:
        assert (row["stop_time_s"] is not None) == (row["ended"] == "stopped") == (row["stopped_by"] is not None)
        assert (row["ended"] == "duration") == (row["ticks"] == 10)
    lengths = series_in(tmp_path / "packed").group_by("run").len().sort("run")["len"].to_list()
    assert lengths == [row["ticks"] for row in rows]
    responses = read_campaign(tmp_path / "packed").responses
    times = {response.column for response in responses if response.kind == "time"}
    assert times == {"stop_time_s", "aggregation_time_s"}


def test_agent_that_fails_for_some_seeds_costs_no_others(tmp_path, stumbling, executors):
    done = sweep(stumbling, seeds=4, out=tmp_path / "c", batch=4)
    rows = rows_in(tmp_path / "c")
    failed = [row["seed"] for row in rows if row["ended"] == "failed"]
    assert done.is_over
    assert done.failed == len(failed)
    assert 0 < len(failed) < 4
    for row in rows:
        assert (row["error"] is None) == (row["seed"] not in failed) == (row["order.final"] is not None)
        if row["error"]:
            assert "ValueError: stumbled" in row["error"]
            assert 'File "scenario/files/stumbling.py", line' in row["error"]
    assert set(series_in(tmp_path / "c")["run"]) == {seed - 1 for seed in range(1, 5) if seed not in failed}
    sweep(stumbling, seeds=4, out=tmp_path / "unpacked", batch=1)
    assert rows_in(tmp_path / "unpacked") == rows


def test_seed_without_room_is_a_failed_row(tmp_path, scenario, executors):
    crowd = ["robots.pair.count=20", 'robots.pair.place={how="disc", radius_m=0.05}']
    done = sweep(scenario, seeds=2, out=tmp_path / "c", overrides=crowd)
    assert done.failed == 2
    assert "room" in rows_in(tmp_path / "c")[0]["error"]


def test_custom_metric_that_raises_is_a_failed_row(tmp_path, scenario, executors):
    (tmp_path / "bad.py").write_text(
        "from dataclasses import dataclass\nfrom swarmwire.metrics.measures.metric import Metric\n"
        "@dataclass(frozen=True)\nclass Bad(Metric):\n    name = 'bad'; help = ''; bounds = (0.0, None)\n"
        "    def begin(self, static): return self\n    def __call__(self, moment): raise RuntimeError('no number')\n"
    )
    assert sweep(scenario, seeds=2, out=tmp_path / "c", overrides=['metrics=["bad.py:Bad"]']).failed == 2
    assert "no number" in rows_in(tmp_path / "c")[1]["error"]


@pytest.mark.parametrize(
    ("step", "error"),
    [
        ("raise OSError('a\\udc80b')", "OSError: a?b"),  # a text that no file can hold
        ("self.step(it)", "RecursionError"),
    ],
)
def test_agent_with_an_odd_error_fails_alike_in_any_pack(tmp_path, scenario, executors, step, error):
    agent = [f"robots.pair.agent={agent_in(tmp_path, 'odd', step)}"]
    for batch in (1, 2):
        sweep(scenario, seeds=2, out=tmp_path / f"packed{batch}", overrides=agent, batch=batch)
    assert error in rows_in(tmp_path / "packed1")[0]["error"]
    assert rows_in(tmp_path / "packed1") == rows_in(tmp_path / "packed2")


@pytest.fixture
def typed(monkeypatch, capsys, executors):
    return lambda *arguments: called(monkeypatch, capsys, *arguments)


def test_sweep_prints_what_it_did_and_what_to_do_next(tmp_path, scenario, typed):
    folder, options = tmp_path / "c", ("--vary", "radio.loss=0:0.5:2", "--seeds", "3", "--set", "duration_s=0.3")
    code, out, errors = typed("sweep", scenario, *options, "--out", folder)
    assert (code, errors) == (0, "")
    for text in ("two robots: 2 points x 3 seeds = 6 runs", "6/6 runs", f"swarmwire report {folder}"):
        assert text in out
    assert out.endswith(f"swarmwire repeat {folder} --run 5\n")
    about = json.loads((folder / "campaign.json").read_text())
    assert about["command"].startswith(f"swarmwire sweep {scenario} --vary radio.loss=0:0.5:2 --seeds 3")
    assert about["overrides"] == ["duration_s=0.3"]
    assert {row["ticks"] for row in rows_in(folder)} == {3}


def test_seeds_mean_the_same_to_run_to_sweep_and_in_a_campaigns_file(tmp_path, scenario, typed):
    arguments = (scenario, "--seeds", "2", "--set", "duration_s=0.1", "--quiet", "--out")
    assert typed("run", *arguments, tmp_path / "run", "--no-rrd")[0] == 0
    assert typed("sweep", *arguments, tmp_path / "sweep")[0] == 0
    (tmp_path / "file.toml").write_text(f'format = 1\nscenario = "{scenario.name}"\nseeds = 2\nrecord_seeds = "2"\n')
    of_file = spec_in(tmp_path / "file.toml", campaign_file(tmp_path / "file.toml"))
    assert of_file.seeds == of_file.record_seeds == (1, 2)
    for written in ("run/run.json", "sweep/campaign.json"):
        assert json.loads((tmp_path / written).read_text())["seeds"] == [1, 2]


def test_campaign_file_means_the_same_as_options_which_override_it(tmp_path, scenario, typed):
    (tmp_path / "losses.toml").write_text(CAMPAIGN)
    assert typed("sweep", tmp_path / "losses.toml", "--out", tmp_path / "a")[0] == 0
    options = ("--vary", "radio.loss=0:0.5:2", "--vary", "robots.pair.count=3", "--seeds", "2")
    assert typed("sweep", scenario, *options, "--set", "duration_s=0.3", "--out", tmp_path / "b")[0] == 0
    assert rows_in(tmp_path / "a") == rows_in(tmp_path / "b")
    assert json.loads((tmp_path / "a" / "campaign.json").read_text())["name"] == "losses"
    fewer = ("--seeds", "1", "--vary", "radio.loss=0.1")
    assert typed("sweep", tmp_path / "losses.toml", *fewer, "--out", tmp_path / "c")[0] == 0
    assert [row["radio.loss"] for row in rows_in(tmp_path / "c")] == [0.1]


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("secnario = 'two.toml'", "secnario: "),
        ("format = 2", "format: "),
        ("seeds = 0", "seeds: "),
        ("design = 'gird'", "--design: "),
        ("vary = { 'radio.loss' = 3 }", r"vary\.radio\.loss: "),
        ("vary = { 'radio.lss' = [1] }", r"vary\.radio\.lss: radio\.lss: "),
        ("overrides = [3]", r"overrides\[0\]: "),
    ],
)
def test_campaign_file_that_is_invalid_is_refused_in_a_line(tmp_path, scenario, monkeypatch, capsys, line, message):
    keys = {"format": "1", "scenario": "'two.toml'", "seeds": "2"} | dict([line.split(" = ", 1)])
    file = tmp_path / "campaign.toml"
    file.write_text("\n".join(f"{key} = {value}" for key, value in keys.items()))
    match = f"(.*campaign.toml: )?{message}"
    refused_command(monkeypatch, capsys, "sweep", file, "--out", tmp_path / "c", match=match)
    assert not (tmp_path / "c").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "SCENARIO: is missing"),
        (["two.toml"], "--seeds: is missing"),
        (["two.toml", "--seeds", "2", "--vary", "radio.losss=0,1"], "--vary radio.losss=0,1: radio.losss: "),
        (["two.toml", "--seeds", "2", "--design", "list"], "--design: .*empty"),
        (["--resume", "nowhere"], "nowhere: "),
        (["--resume", "nowhere", "--seeds", "3"], "SCENARIO: "),
        (["two.toml", "--seeds", "2", "--record-seeds", "9"], "--record-seeds: "),
    ],
)
def test_sweep_options_that_are_invalid_are_refused_in_a_line(
    tmp_path, scenario, monkeypatch, capsys, arguments, message
):
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.iterdir())
    refused_command(monkeypatch, capsys, "sweep", *arguments, match=message)
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


def test_repeat_of_a_campaign_takes_the_number_of_a_run(tmp_path, scenario, typed):
    folder = tmp_path / "c"
    typed("sweep", scenario, "--vary", "radio.loss=0,0.5", "--seeds", "4:6", "--out", folder)
    code, out, errors = typed("repeat", folder, "--run", "3", "--out", tmp_path / "again")
    row, again = rows_in(folder)[3], RunFolder(tmp_path / "again")
    assert (code, errors) == (0, "")
    assert f"seed 5: trajectory {row['trajectory_sha256'][:16]}…" in out
    assert again.summary["trajectory_sha256"] == [row["trajectory_sha256"]]
    (folder / "summary.parquet").unlink()
    code, out, _ = typed("repeat", folder, "--run", "3")
    assert (code, "nothing to compare with" in out) == (1, True)
    assert typed("repeat", folder, "--run", "4")[2].startswith("error: --run: ")
    assert "--run" in typed("repeat", folder)[2]
    assert typed("repeat", tmp_path / "again", "--run", "0")[0] == 2


class Interrupting(NoObserver):
    """Presses Ctrl-C after the first task."""

    pressed = False

    def see(self, result):
        if not self.pressed:
            self.pressed = True
            os.kill(os.getpid(), signal.SIGINT)


def test_ctrl_c_ends_it_with_a_word_how_to_go_on(tmp_path, scenario, typed, monkeypatch):
    folder = tmp_path / "c"
    monkeypatch.setattr("swarmwire.deploy.cli.actions.sweep.SweepProgress", lambda _: Interrupting())
    code, out, errors = typed("sweep", scenario, "--seeds", "5", "--batch", "1", "--out", folder)
    assert (code, errors) == (130, "")
    assert "3 of 5 runs" in out
    assert out.endswith(f"swarmwire sweep --resume {folder}\n")
    assert typed("sweep", "--resume", folder)[0] == 0
    assert len(rows_in(folder)) == 5
