"""A campaign from end to end: its table does not depend on who did what, when and how it was packed."""

import json

import numpy as np
import polars as pl
import pytest

from swarmwire.deploy import RunFolder, run, sweep
from swarmwire.deploy.campaign import sweep as sweeping
from swarmwire.metrics.campaign.spec import read_campaign
from tests.support.deploy.campaign import InThisProcess, rows_in, scenario_in, series_in

VARY = {"radio.loss": "0:0.8:2", "robots.pair.count": [2, 3]}


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


def test_each_run_has_a_row_that_says_what_a_run_of_its_own_would(reference):
    rows = rows_in(reference / "c")
    assert [(row["run"], row["point"], row["seed"]) for row in rows] == [
        (i, i // 3, i % 3 + 1) for i in range(12)
    ]  # fmt: skip
    assert [(row["radio.loss"], row["robots.pair.count"]) for row in rows[::3]] == [
        (0.0, 2),
        (0.0, 3),
        (0.8, 2),
        (0.8, 3),
    ]
    alone = run(reference / "two.toml", seed=2, overrides=["radio.loss=0.8", "robots.pair.count=3"])
    row, radio = rows[10], alone.radio
    assert radio is not None
    assert row["trajectory_sha256"] == alone.trajectory_sha256[0]
    assert (row["ended"], row["error"], row["ticks"], row["sim_time_s"]) == ("duration", None, 5, 0.5)
    assert row["order.mean"] == alone.metrics["order"].mean
    assert (row["radio.sent"], row["radio.pdr"], row["radio.link_pdr"]) == (radio.sent, radio.pdr, radio.link_pdr)
    assert row["radio.fates.lost"] == radio.fates["lost"]
    assert row["radio.latency_air_s.p90"] == radio.latency_air_s.p90
    assert row["target_best.final"] is None


def test_rows_and_series_do_not_depend_on_packs(reference, tmp_path, here):
    sweep(reference / "two.toml", seeds=3, vary=VARY, out=tmp_path / "c", batch=2)
    assert rows_in(tmp_path / "c") == rows_in(reference / "c")
    assert series_in(tmp_path / "c").equals(series_in(reference / "c"), null_equal=True)
    assert here[0].closed


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


def test_the_folder_says_what_was_run_and_holds_nothing_else(reference):
    found = json.loads((reference / "c" / "campaign.json").read_text())
    assert sorted(path.name for path in (reference / "c").iterdir()) == [
        "campaign.json", "scenario", "series", "summary.parquet"
    ]  # fmt: skip
    assert found["format"] == 1
    assert found["vary"] == {"radio.loss": [0.0, 0.8], "robots.pair.count": [2, 3]}
    assert found["points"][2] == {"radio.loss": 0.8, "robots.pair.count": 2}
    assert found["seeds"] == [1, 2, 3]
    assert (found["design"], found["scenario"], found["name"]) == ("grid", "two robots", "two robots")
    assert (reference / "c" / "scenario" / "scenario.toml").exists()


def test_without_series_there_are_none(scenario, tmp_path, here):
    sweep(scenario, seeds=2, out=tmp_path / "c", series=False)
    assert not (tmp_path / "c" / "series").exists()
    assert len(rows_in(tmp_path / "c")) == 2


def test_files_that_points_name_are_kept_with_the_campaign(tmp_path, scenario, here):
    for name, speed in (("slow", 0.01), ("fast", 0.1)):
        code = (
            f"from swarmwire.agent import Agent\nclass Mine(Agent):\n    def step(self, it): it.drive({speed}, 0.0)\n"
        )
        (tmp_path / f"{name}.py").write_text(code)
    agents = [f"{name}.py:Mine" for name in ("slow", "fast")]
    sweep(scenario, seeds=1, vary={"robots.pair.agent": agents}, out=tmp_path / "c")
    campaign = read_campaign(tmp_path / "c")
    assert [point["robots.pair.agent"] for point in campaign.points] == agents
    assert {file.path for file in campaign.files} == {"scenario.toml", "files/slow.py", "files/fast.py"}
    for agent, row in zip(agents, rows_in(tmp_path / "c"), strict=True):
        assert run(scenario, overrides=[f"robots.pair.agent={agent}"]).trajectory_sha256 == [row["trajectory_sha256"]]


def test_chosen_seeds_are_recorded_in_full(tmp_path, scenario, here):
    sweep(scenario, seeds=2, vary={"radio.loss": [0.0, 0.5]}, out=tmp_path / "c", record_seeds=[2])
    assert sorted(path.name for path in (tmp_path / "c" / "runs").iterdir()) == ["run-000001", "run-000003"]
    recorded = RunFolder(tmp_path / "c" / "runs" / "run-000003")
    assert (recorded.path / "run.rrd").exists()
    assert recorded.summary is not None
    assert recorded.summary["trajectory_sha256"] == [rows_in(tmp_path / "c")[3]["trajectory_sha256"]]


def test_where_workers_cannot_write_here_recorded_runs_are_done_on_this_machine_at_the_end(
    tmp_path, scenario, monkeypatch
):
    done_by, there, local = list[tuple[str, int]](), InThisProcess(), InThisProcess()
    there.records = False
    for name, executor in (("there", there), ("local", local)):
        monkeypatch.setattr(executor, "submit", noting(executor.submit, name, done_by))
    monkeypatch.setattr(sweeping, "open_executor", lambda name, *_: local if name == "local" else there)
    sweep(scenario, seeds=3, out=tmp_path / "c", record_seeds=[2], batch=1, executor="there://")
    assert done_by == [("there", 1), ("there", 3), ("local", 2)]
    assert (there.closed, local.closed) == (True, True)
    assert [path.name for path in (tmp_path / "c" / "runs").iterdir()] == ["run-000001"]
    assert [row["ended"] for row in rows_in(tmp_path / "c")] == ["duration"] * 3


def noting(submit, name, done_by):
    """`submit` that notes each task's seed."""

    def submit_noted(task):
        done_by.extend((name, seed) for seed in task.seeds)
        submit(task)

    return submit_noted


def test_drawn_designs_say_between_which_values(tmp_path, scenario, here):
    sweep(scenario, seeds=1, vary={"radio.loss": "0:0.5"}, design="latin", points=4, out=tmp_path / "c")
    campaign = read_campaign(tmp_path / "c")
    assert campaign.vary == {"radio.loss": {"from": 0.0, "to": 0.5}}
    assert [row["radio.loss"] for row in rows_in(tmp_path / "c")] == [point["radio.loss"] for point in campaign.points]


def test_arenas_that_stop_and_times_of_metrics_are_the_same_packed_and_alone(tmp_path, scenario, here):
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
    times = {of.column: of.kind for of in read_campaign(tmp_path / "packed").responses if of.kind == "time"}
    assert times == {"stop_time_s": "time", "aggregation_time_s": "time"}
    assert list(rows[0])[3:10] == [
        "ended", "error", "ticks", "sim_time_s", "trajectory_sha256", "stop_time_s", "stopped_by"
    ]  # fmt: skip


def test_an_agent_that_fails_for_some_seeds_costs_no_others(tmp_path, stumbling, here):
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


def test_a_seed_without_room_is_a_failed_row(tmp_path, scenario, here):
    crowd = ["robots.pair.count=20", 'robots.pair.place={how="disc", radius_m=0.05}']
    done = sweep(scenario, seeds=2, out=tmp_path / "c", overrides=crowd)
    assert done.failed == 2
    assert "room" in rows_in(tmp_path / "c")[0]["error"]


def test_a_metric_of_ones_own_that_raises_is_a_failed_row(tmp_path, scenario, here):
    (tmp_path / "bad.py").write_text(
        "from dataclasses import dataclass\nfrom swarmwire.metrics.metric import Metric\n"
        "@dataclass(frozen=True)\nclass Bad(Metric):\n    name = 'bad'; help = ''; bounds = (0.0, None)\n"
        "    def begin(self, static): return self\n    def __call__(self, moment): raise RuntimeError('no number')\n"
    )
    assert sweep(scenario, seeds=2, out=tmp_path / "c", overrides=['metrics=["bad.py:Bad"]']).failed == 2
    assert "no number" in rows_in(tmp_path / "c")[1]["error"]


def test_an_error_that_no_file_can_hold_is_told_as_far_as_it_can(tmp_path, scenario, here):
    agent = (
        "from swarmwire.agent import Agent\nclass Odd(Agent):\n    def step(self, robot): raise OSError('a\\udc80b')\n"
    )
    (tmp_path / "odd.py").write_text(agent)
    sweep(scenario, seeds=1, out=tmp_path / "c", overrides=['robots.pair.agent="odd.py:Odd"'])
    assert "OSError: a?b" in rows_in(tmp_path / "c")[0]["error"]


def test_an_agent_that_calls_itself_for_ever_fails_alike_in_any_pack(tmp_path, scenario, here):
    agent = "from swarmwire.agent import Agent\nclass Deep(Agent):\n    def step(self, robot): self.step(robot)\n"
    (tmp_path / "deep.py").write_text(agent)
    for batch in (1, 2):
        overrides = ['robots.pair.agent="deep.py:Deep"']
        sweep(scenario, seeds=2, out=tmp_path / f"packed{batch}", overrides=overrides, batch=batch)
    assert "RecursionError" in rows_in(tmp_path / "packed1")[0]["error"]
    assert rows_in(tmp_path / "packed1") == rows_in(tmp_path / "packed2")
